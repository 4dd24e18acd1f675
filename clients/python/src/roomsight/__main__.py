"""``python -m roomsight FOLDER``: streams the pictures of a folder and prints the room of each."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import re
import ssl
import sys
import time
from pathlib import Path

from . import Client, Dropped, Result, RoomsightError

SUFFIXES = {".jpg", ".jpeg", ".jfif", ".png", ".webp", ".bmp", ".pgm", ".ppm"}
# How JPEG, PNG, WebP and BMP begin, whatever the file is called.
BEGINNINGS = (b"\xff\xd8\xff", b"\x89PNG\r\n", b"RIFF", b"BM")


def main() -> int:
    """Parses the command line and streams; the exit code is 1 where the service or the folder fails."""
    parser = argparse.ArgumentParser(prog="python -m roomsight", description=__doc__)
    parser.add_argument("folder", type=Path, help="pictures, also in folders below, sent in the order of their names")
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="the service (%(default)s)")
    parser.add_argument("--key", default=os.environ.get("ROOMSIGHT_KEY"), help="or ROOMSIGHT_KEY")
    parser.add_argument("--ca", help="the authority of the service's certificate, a file of PEM")
    parser.add_argument("--model", help="the model that answers (the default one)")
    parser.add_argument("--robot", help="the name of the robot")
    parser.add_argument("--rate", type=frame_rate, default=5.0, help="frames a second (%(default)s)")
    arguments = parser.parse_args()
    try:
        stream_frames(arguments, pictures(arguments.folder))
    except (RoomsightError, OSError, ValueError) as error:
        print(f"roomsight: {error}", file=sys.stderr)
        return 1
    return 0


def frame_rate(text: str) -> float:
    """Frames a second. Raises argparse's error where they are none."""
    with contextlib.suppress(ValueError):
        rate = float(text)
        if 0.0 < rate < math.inf:
            return rate
    raise argparse.ArgumentTypeError(f"{text!r} is no number of frames a second; give one above 0, such as 5")


def pictures(folder: Path) -> list[Path]:
    """The pictures in a folder and in those below it, by name; hidden files and all else are left out and counted.

    Raises ValueError where there is none."""
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder; give a folder of pictures")
    entries = sorted((path for path in folder.rglob("*") if not path.is_dir()), key=by_number)
    found: list[Path] = []
    left_out: list[Path] = []
    for entry in entries:
        is_wanted = not is_hidden(entry.relative_to(folder)) and is_picture(entry)
        (found if is_wanted else left_out).append(entry)
    if not found:
        raise ValueError(f"{folder}: no picture lies in it or in a folder below it; give a folder of pictures")
    if left_out:
        more = f" and {len(left_out) - 1} more" if len(left_out) > 1 else ""
        print(f"left out: {left_out[0]}{more}: no picture", file=sys.stderr)
    return found


def is_hidden(path: Path) -> bool:
    """Whether it, or a folder that it lies in, is hidden."""
    return any(part.startswith(".") for part in path.parts)


def by_number(path: Path) -> list[tuple[int, str]]:
    """Sorts paths as people number pictures: 2.jpg before 10.jpg."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (0, part) for part in parts]


def is_picture(path: Path) -> bool:
    """Whether it is a file that is called a picture or begins as one. Pipes and devices are not opened."""
    if not path.is_file():
        return False
    if path.suffix.lower() in SUFFIXES:
        return True
    with path.open("rb") as file:
        return file.read(8).startswith(BEGINNINGS)


def stream_frames(arguments: argparse.Namespace, frames: list[Path]) -> None:
    """Sends the frames at their rate, one after the other."""
    believed = ssl.create_default_context(cafile=arguments.ca) if arguments.ca else None
    with Client(arguments.url, arguments.key, ssl=believed) as client, client.stream(
        robot=arguments.robot, model=arguments.model
    ) as stream:
        due = time.monotonic()
        for frame in frames:
            time.sleep(max(0.0, due - time.monotonic()))
            due += 1.0 / arguments.rate
            stream.send(frame, captured_at_ns=time.time_ns())
            answer = stream.answer()
            name = frame.relative_to(arguments.folder)
            if isinstance(answer, Result):
                known = answer.filtered.known if answer.filtered else answer.answer.known
                print(f"{name}  {answer.room}  {answer.probability:.2f}  {'known' if known else why(answer)}")
            elif isinstance(answer, Dropped):
                print(f"{name}  dropped: {answer.reason}")
            else:
                print(f"{name}  {answer.problem.title}: {answer.problem.detail}")


def why(result: Result) -> str:
    """Why a room is not one to act on."""
    return f"unknown: {(result.answer.unknown or 'unsure').replace('_', ' ')}"


if __name__ == "__main__":
    sys.exit(main())
