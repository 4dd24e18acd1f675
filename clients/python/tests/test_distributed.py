"""Tasks of a Dask cluster: what they give is what one machine gives, also where a worker is killed meanwhile."""

import logging
import os
import signal
import subprocess
import tempfile
import unittest
import warnings
from pathlib import Path
from unittest import mock

from roomsight import distributed, program
from running import BINARY

try:
    from distributed import Client, LocalCluster
except ImportError as error:
    raise unittest.SkipTest(f"Dask is not installed: {error}") from error

#: Parameters that make training quick.
QUICK = {"set": {"representation.n_words": 40, "seed": 2}}


class Distributed(unittest.TestCase):
    """Six short drives of the simulated lab, and two workers."""

    folder: Path
    lab: Path
    cluster: Client

    @classmethod
    def setUpClass(cls) -> None:
        # A cluster of processes leaves sockets to the system.
        warnings.simplefilter("ignore", ResourceWarning)
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.lab = cls.folder / "lab"
        named = mock.patch.dict(os.environ, ROOMSIGHT=BINARY)
        named.start()
        cls.addClassCleanup(named.stop)
        drives = ["--camera=omni", "--frames-per-second=0.1"]
        subprocess.run([BINARY, "simulate", str(cls.lab), *drives], check=True, stdout=subprocess.DEVNULL)
        cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL)
        cls.addClassCleanup(cluster.close)
        cls.cluster = Client(cluster)
        cls.addClassCleanup(cls.cluster.close)

    def kill_a_worker(self, n_done: int, n_tasks: int) -> None:
        """With the first task that is done."""
        if n_done == 1:
            pids = self.cluster.run(os.getpid)
            os.kill(next(iter(pids.values())), signal.SIGKILL)
            self.killed = True

    def test_a_model_is_the_same_byte_for_byte_though_a_worker_is_killed(self) -> None:
        alone, together, parts = (self.folder / name for name in ("alone", "together", "parts"))
        program.train(self.lab, alone, **QUICK)
        self.killed = False
        report = distributed.train(
            self.cluster, self.lab, together, parts=parts, n_parts=9, progress=self.kill_a_worker, options={"min_rate": 0.1}, **QUICK
        )
        self.assertTrue(self.killed)
        self.assertEqual(report["model"], str(together))
        self.assertEqual(len(list(parts.glob("part-*-of-9.frames.json"))), 9)
        for name in ("model.safetensors", "model.json", "golden/golden.json"):
            self.assertEqual((together / name).read_bytes(), (alone / name).read_bytes(), name)
        again = distributed.describe(self.cluster, self.lab, parts, n_parts=9, **QUICK)
        self.assertTrue(all(part["was_there"] for part in again))
        self.assertEqual(sum(part["n_frames"] for part in again), program.run("check", self.lab, pictures_only=True)["n_frames"])

    def test_rates_are_the_same_to_the_last_digit(self) -> None:
        options = {"train": "*cloudy1", "test": ["*night1"], "set": {"representation.n_words": 40}}
        self.assertEqual(
            distributed.validate(self.cluster, self.lab, seeds=3, **options), program.run("validate", self.lab, seeds=3, **options)
        )

    def test_an_experiment_says_the_same(self) -> None:
        options = {"quick": True, "seeds": 2, "set": {"representation.n_words": 20}}
        reports = [
            program.run("experiment", "kernels", data=self.lab, report=self.folder / "report", **options),
            distributed.experiment(self.cluster, "kernels", self.lab, self.folder / "shared", n_parts=3, **options),
        ]
        for report in reports:
            self.assertTrue(report.pop("origin"))
        self.assertEqual(reports[0], reports[1])

    def test_what_fails_is_told(self) -> None:
        with self.assertRaisesRegex(program.ProgramError, "nowhere") as raised:
            distributed.describe(self.cluster, "nowhere", self.folder / "none", n_parts=2)
        self.assertEqual(raised.exception.exit_code, 1)


if __name__ == "__main__":
    unittest.main()
