"""What deploy/ holds beside proxies, by the tools that take it: Helm, the schemas of Kubernetes and Compose, systemd, hadolint, HAProxy, Prometheus.

Each is left out where its tool is missing, and says so. UPDATE=1 writes deploy/kubernetes/roomsight.yaml anew.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import compose_spec
    import kubernetes_validate
    import yaml
except ImportError as error:
    raise unittest.SkipTest(f"deploy/ is not checked: {error}") from error

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
CHART = DEPLOY / "helm" / "roomsight"
MANIFESTS = DEPLOY / "kubernetes" / "roomsight.yaml"
ROOMSIGHT = os.environ.get("ROOMSIGHT", str(ROOT / "target" / "debug" / "roomsight"))
HEAD = """# Written by `helm template roomsight deploy/helm/roomsight --namespace roomsight`: what the chart makes by default, for those without Helm.
#   kubectl create namespace roomsight
#   kubectl -n roomsight create secret generic roomsight --from-literal=keys="$KEYS" --from-literal=resume_keys="$(openssl rand -hex 32)"
#   kubectl -n roomsight create secret generic roomsight-bucket --from-literal=AWS_REGION=... (as values.yaml tells)
#   kubectl apply -n roomsight -f deploy/kubernetes/roomsight.yaml
"""
# Everything that a chart can switch on.
ALL = {
    "autoscaling": {"byFrames": {"enabled": True}},
    "ingress": {"enabled": True, "className": "nginx", "tlsSecret": "rooms-tls"},
    "serviceMonitor": {"enabled": True, "labels": {"release": "prometheus"}},
    "networkPolicy": {"from": [{"podSelector": {}}], "to": [{"ipBlock": {"cidr": "10.0.0.0/8"}}]},
    "modelsClaim": "rooms",
    "nats": "nats://nats.rooms:4222",
    "models": "/models",
    "serviceAccount": {"annotations": {"eks.amazonaws.com/role-arn": "arn:aws:iam::1:role/rooms"}},
    "image": {"repository": "registry.example/roomsight", "tag": "@sha256:" + 64 * "0"},
    "settings": {"log_level": "roomsight=debug", "caller_share": 0.25, "origins": ["https://rooms.example"], "max_streams": 100000},
}
VERSIONS = ["1.27", "1.31", "1.34"]


def tool(name: str) -> str:
    """Where a program is, beside this Python or on the path."""
    places = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", ""), "/usr/sbin"])
    found = shutil.which(name, path=places)
    if found is None:
        raise unittest.SkipTest(f"{name} is not installed")
    return found


def run(*command: str, **more: object) -> str:
    """What a program prints; an error with what it complains of, where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, **more)
    if done.returncode != 0:
        raise AssertionError(f"{command[0]} failed: {done.stdout}{done.stderr}")
    return done.stdout


def rendered(values: dict | None = None) -> str:
    """What the chart makes with values over its own."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        yaml.safe_dump(values or {}, file)
        file.flush()
        return run(tool("helm"), "template", "roomsight", str(CHART), "--namespace", "roomsight", "--values", file.name)


def objects(text: str) -> dict[str, dict]:
    """Objects by their kind, of which there is one each."""
    return {document["kind"]: document for document in yaml.safe_load_all(text) if document}


class Chart(unittest.TestCase):
    def test_the_manifests_are_those_of_the_chart(self) -> None:
        now = HEAD + rendered()
        if os.environ.get("UPDATE"):
            MANIFESTS.write_text(now)
        self.assertEqual(MANIFESTS.read_text(), now, "UPDATE=1 make test-deploy writes it anew")

    def test_helm_finds_nothing_wrong(self) -> None:
        run(tool("helm"), "lint", "--strict", str(CHART))

    def test_kubernetes_takes_all_that_it_makes(self) -> None:
        for values in ({}, ALL, {"autoscaling": {"enabled": False}, "bucketSecret": ""}):
            for document in objects(rendered(values)).values():
                # That of the Prometheus operator is in no schema of Kubernetes.
                for version in VERSIONS if document["kind"] != "ServiceMonitor" else []:
                    with self.subTest(kind=document["kind"], version=version):
                        kubernetes_validate.validate(document, version, strict=True)

    def test_all_that_can_be_switched_on_is_made(self) -> None:
        made = objects(rendered(ALL))
        self.assertLessEqual({"Ingress", "ServiceMonitor", "HorizontalPodAutoscaler", "PodDisruptionBudget", "NetworkPolicy"}, set(made))
        metrics = made["HorizontalPodAutoscaler"]["spec"]["metrics"]
        self.assertEqual([metric["type"] for metric in metrics], ["Resource", "Pods", "Pods"])
        container = made["Deployment"]["spec"]["template"]["spec"]["containers"][0]
        self.assertEqual(container["image"], "registry.example/roomsight@sha256:" + 64 * "0")
        self.assertNotIn("replicas", made["Deployment"]["spec"])

    def test_pods_may_do_nothing_that_they_do_not_need(self) -> None:
        pod = objects(rendered())["Deployment"]["spec"]["template"]["spec"]
        container = pod["containers"][0]
        self.assertTrue(pod["securityContext"]["runAsNonRoot"])
        self.assertTrue(container["securityContext"]["readOnlyRootFilesystem"])
        self.assertEqual(container["securityContext"]["capabilities"], {"drop": ["ALL"]})
        self.assertFalse(container["securityContext"]["allowPrivilegeEscalation"])
        self.assertFalse(pod["automountServiceAccountToken"])

    def test_a_pod_is_left_and_drained_before_it_is_killed(self) -> None:
        made = objects(rendered({"stopping": {"leaveSeconds": 7, "drainSeconds": 33}}))
        pod = made["Deployment"]["spec"]["template"]["spec"]
        self.assertEqual(pod["containers"][0]["lifecycle"]["preStop"]["exec"]["command"], ["sleep", "7"])
        self.assertIn("drain_timeout_ms = 33000", made["ConfigMap"]["data"]["roomsight.toml"])
        self.assertGreater(pod["terminationGracePeriodSeconds"], 40)

    def test_the_service_takes_the_settings(self) -> None:
        for values, wanted in [({}, ["max_streams = 4096", "threads = 2"]), (ALL, ["max_streams = 100000", "caller_share = 0.25"])]:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "roomsight.toml"
                file.write_text(objects(rendered(values))["ConfigMap"]["data"]["roomsight.toml"])
                settings = run(tool(ROOMSIGHT), "serve", "--config", str(file), "--print-config", env={"ROOMSIGHT_DATA": ""})
            for line in [*wanted, 'data = ""', 'listen = "0.0.0.0:8080"']:
                self.assertIn(line, settings.splitlines())

    def test_the_adapter_asks_for_metrics_that_there_are(self) -> None:
        text = (DEPLOY / "kubernetes" / "prometheus-adapter.yaml").read_text()
        rules = yaml.safe_load(text)["rules"]["custom"]
        scaled_by = {metric["pods"]["metric"]["name"] for metric in objects(rendered(ALL))["HorizontalPodAutoscaler"]["spec"]["metrics"][1:]}
        self.assertEqual({rule["name"]["as"] for rule in rules}, scaled_by)
        told = (ROOT / "docs" / "METRICS.md").read_text()
        asked = {re.sub("_(sum|count)$", "", name) for rule in rules for name in re.findall(r"roomsight_\w+", rule["metricsQuery"])}
        self.assertEqual({name for name in asked if f"`{name}`" not in told}, set())


class Machines(unittest.TestCase):
    def test_compose_takes_its_file(self) -> None:
        text = (DEPLOY / "compose" / "compose.yaml").read_text()
        # The schema knows values and no merge keys, which Compose itself resolves.
        merged = {name: part for name, part in yaml.safe_load(text).items() if not name.startswith("x-")}
        services = compose_spec.PyCompose.from_yaml(yaml.safe_dump(merged)).services
        self.assertEqual(set(services), {"bucket", "first-model", "roomsight", "nats", "haproxy", "prometheus", "grafana"})
        for service in merged["services"].values():
            for volume in service.get("volumes", []):
                self.assertTrue((DEPLOY / "compose" / volume.split(":")[0]).is_file(), volume)

    def test_every_variable_for_the_service_is_a_setting(self) -> None:
        settings = run(tool(ROOMSIGHT), "serve", "--print-config")
        names = {f"ROOMSIGHT_{line.split(' = ')[0].upper()}" for line in settings.splitlines()} | {"ROOMSIGHT_KEYS", "ROOMSIGHT_RESUME_KEYS"}
        for path in [*DEPLOY.rglob("*"), ROOT / "Dockerfile"]:
            if path.is_file():
                used = set(re.findall(r"\bROOMSIGHT_[A-Z_]+", path.read_text()))
                self.assertEqual(used - names, set(), path)

    def test_haproxy_takes_its_file(self) -> None:
        run(tool("haproxy"), "-c", "-f", str(DEPLOY / "compose" / "haproxy.cfg"))

    def test_prometheus_takes_its_file(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            for file in [DEPLOY / "compose" / "prometheus.yml", ROOT / "docs" / "alerts.yml"]:
                shutil.copy(file, folder)
            run(tool("promtool"), "check", "config", f"{folder}/prometheus.yml")

    def test_systemd_takes_the_unit(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            # It looks for the program too.
            unit = Path(folder) / "roomsight.service"
            unit.write_text((DEPLOY / "roomsight.service").read_text().replace("/usr/local/bin/roomsight", "/bin/true"))
            verify = [tool("systemd-analyze"), "verify", str(unit)]
            # What it does not know it says, and takes all the same.
            self.assertEqual(subprocess.run(verify, capture_output=True, text=True).stderr, "")

    def test_the_image_is_built_by_the_rules(self) -> None:
        run(tool("hadolint"), "--failure-threshold", "info", str(ROOT / "Dockerfile"))


if __name__ == "__main__":
    unittest.main()
