"""Where things are."""

import os
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[4]
BINARY = os.environ.get("ROOMSIGHT", str(REPOSITORY / "target/debug/roomsight"))
MODEL = REPOSITORY / "models" / "simulated-lab" / "1"
PICTURES = {path.stem: path for path in sorted((MODEL / "golden").glob("*.jpeg"))}
