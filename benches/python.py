"""CPU of a frame within Python, beside the program: `python benches/python.py`, where the wheel is installed (`make wheel`).

The program recognizes files, once as many and twice as many; the difference is what it takes for them without its start. Python
recognizes the same files, and their pixels as arrays. Each is measured in turn, and medians are printed.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from pathlib import Path

import numpy
from PIL import Image
from roomsight import Recognizer
from roomsight.program import executable

MODEL = Path(__file__).resolve().parents[1] / "models" / "simulated-lab" / "1"
FRAMES = sorted((MODEL / "golden").glob("*.jpeg"))
N_FRAMES = 400
ROUNDS = 7


def of_program(n_frames: int) -> float:
    """Seconds of CPU of the program for so many frames."""
    frames = [str(FRAMES[idx % len(FRAMES)]) for idx in range(n_frames)]
    line = [executable(), "recognize", "--json", str(MODEL), *frames]
    process = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0
    return usage.ru_utime + usage.ru_stime


def of_python(recognizer: Recognizer, frames: list) -> float:
    """The same of this thread."""
    before = time.thread_time()
    for idx in range(N_FRAMES):
        recognizer.recognize(frames[idx % len(frames)])
    return time.thread_time() - before


def main() -> None:
    recognizer = Recognizer(MODEL)
    pictures = [Image.open(frame) for frame in FRAMES]
    kinds = {
        "files": FRAMES,
        "arrays of red, green, blue": [numpy.asarray(picture.convert("RGB")) for picture in pictures],
        "gray arrays": [numpy.asarray(picture.convert("L")) for picture in pictures],
    }
    taken: dict[str, list[float]] = {"the program, files": [], **{f"Python, {kind}": [] for kind in kinds}}
    for _ in range(ROUNDS):
        taken["the program, files"].append(of_program(2 * N_FRAMES) - of_program(N_FRAMES))
        for kind, frames in kinds.items():
            taken[f"Python, {kind}"].append(of_python(recognizer, frames))
    program = statistics.median(taken["the program, files"])
    for name, seconds in taken.items():
        median = statistics.median(seconds)
        print(f"{name:<36} {1000 * median / N_FRAMES:.3f} ms a frame, {median / program:.2f} of the program")


if __name__ == "__main__":
    main()
