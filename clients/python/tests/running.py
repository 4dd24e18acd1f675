"""A running service of the example model, and a short drive through the lab that it knows."""

import logging
import os
import socket
import ssl
import subprocess
import tempfile
import time
import unittest
import urllib.request
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[3]
BINARY = os.environ.get("ROOMSIGHT", str(REPOSITORY / "target/debug/roomsight"))
PATIENCE_S = 60.0

# A busy machine is slow; asyncio would tell each time.
logging.getLogger("asyncio").setLevel(logging.ERROR)


class RunningService(unittest.TestCase):
    """What needs a service. It is started once for each class of tests."""

    #: Settings as ``NAME=VALUE``, beside the defaults.
    settings: "list[str]" = []
    #: Where its models are.
    models: Path = REPOSITORY / "models"
    #: Further arguments of `serve`.
    arguments: "list[str]" = []
    #: The authority of the service's certificate, where it has one.
    authority: "Path | None" = None
    folder: "tempfile.TemporaryDirectory[str]"
    process: "subprocess.Popen[bytes]"
    address: str
    url: str
    frames: "list[Path]"

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        drive = ["--camera=omni", "--illumination=cloudy1", "--frames-per-second=0.04"]
        subprocess.run([BINARY, "simulate", cls.folder.name, *drive], check=True, stdout=subprocess.DEVNULL)
        cls.frames = sorted(Path(cls.folder.name).rglob("*.jpeg"))[:6]
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            cls.address = f"127.0.0.1:{free.getsockname()[1]}"
        cls.url = f"{'https' if cls.authority else 'http'}://{cls.address}"
        cls.start()

    @classmethod
    def start(cls) -> None:
        """Starts the service at its address."""
        cls.process = subprocess.Popen(
            [BINARY, "serve", "--models", str(cls.models), "--listen", cls.address, *cls.arguments]
            + [argument for setting in ["log_level=error", *cls.settings] for argument in ("--set", setting)]
        )
        cls.addClassCleanup(cls.process.wait)
        cls.addClassCleanup(cls.process.terminate)
        cls.wait_until_ready()

    @classmethod
    def wait_until_ready(cls) -> None:
        """Until frames are answered."""
        started = time.monotonic()
        while not is_ready(cls.url, cls.authority):
            if cls.process.poll() is not None or time.monotonic() - started > PATIENCE_S:
                raise AssertionError("the service did not get ready")
            time.sleep(0.05)


def is_ready(url: str, authority: "Path | None" = None) -> bool:
    """Whether a service answers frames."""
    believed = ssl.create_default_context(cafile=authority) if authority else None
    try:
        with urllib.request.urlopen(f"{url}/readyz", context=believed) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False
