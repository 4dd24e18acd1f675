"""The commands of the program ``roomsight`` from Python: train, evaluate and what else prints JSON.

    from roomsight import program

    report = program.train("my-rooms", output="models/home/1", progress=print)
    print(report["held_out"]["overall"]["rate"])

Each runs in a process of its own, which can be stopped and gives its memory back. The wheel brings the program; else the one on
``PATH`` is taken, or the one that the variable ``ROOMSIGHT`` names.
"""

from __future__ import annotations

import json
import logging
import os
import shutil
import subprocess
import sysconfig
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Callable, Optional, Union

from . import runtimes
from .errors import RoomsightError

#: Options by their names, ``_`` for ``-``: ``sequences="*cloudy1"`` is ``--sequences '*cloudy1'``. True is a flag alone, None and
#: False are left out, a list is one option each, and a mapping one ``NAME=VALUE`` each: ``set={"seed": 3}``.
Option = Union[str, int, float, bool, None, "os.PathLike[str]", "list[Any]", "Mapping[str, Any]"]
#: Called with what is worked on, how much of it is done, and how much there is.
Progress = Callable[[str, int, int], None]

_log = logging.getLogger("roomsight")


class ProgramError(RoomsightError):
    """A command failed; the message is the program's own. ``exit_code`` 2 is a wrong call, 3 that a gate failed, 1 all else."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message, exit_code)
        self.exit_code = exit_code

    def __str__(self) -> str:
        return str(self.args[0])


def train(
    data: Union[str, os.PathLike[str]],
    output: Union[str, os.PathLike[str]],
    *,
    progress: Optional[Progress] = None,
    **options: Option,
) -> dict[str, Any]:
    """Trains a model on labeled frames into a new folder, and tells how it does on held-out frames, as ``roomsight train --json``."""
    report: dict[str, Any] = run("train", data, progress=progress, output=output, **options)
    return report


def evaluate(
    model: Union[str, os.PathLike[str]],
    data: Union[str, os.PathLike[str]],
    *,
    progress: Optional[Progress] = None,
    **options: Option,
) -> dict[str, Any]:
    """The rates of a model on labeled frames, as ``roomsight evaluate --json``."""
    report: dict[str, Any] = run("evaluate", model, data, progress=progress, **options)
    return report


def run(command: str, *arguments: Any, progress: Optional[Progress] = None, **options: Option) -> Any:
    """What a command tells with ``--json``. Its notes go to the logger ``roomsight``.

    Raises ``ProgramError`` where it fails, ``FileNotFoundError`` where there is no program. It is stopped where this is
    interrupted.
    """
    return json.loads(_said([command, "--json"], arguments, progress, options))


def command(name: str, *arguments: Any, progress: Optional[Progress] = None, **options: Option) -> str:
    """What a command prints that knows no ``--json``. Raises as ``run``."""
    return _said([name], arguments, progress, options)


def _said(command: list[str], arguments: Sequence[Any], progress: Optional[Progress], options: Mapping[str, Option]) -> str:
    """What a command writes on its standard output."""
    line = [executable(), *command, "--progress", "lines", *flags(options), "--", *map(os.fspath, arguments)]
    environment = dict(os.environ)
    library = runtimes.onnx_runtime()
    if library is not None:
        environment["ROOMSIGHT_ONNX_RUNTIME"] = library
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None and process.stderr is not None
        complaints: list[str] = []
        # Both pipes are read, so that neither fills.
        said: list[str] = []
        reader = threading.Thread(target=lambda out: said.append(out.read()), args=(process.stdout,), daemon=True)
        reader.start()
        try:
            for text in process.stderr:
                _hear(text.rstrip("\n"), progress, complaints)
        except BaseException:
            process.terminate()
            raise
        reader.join()
    if process.returncode != 0:
        message = "\n".join(complaints) or f"{command[0]} ended with {process.returncode}"
        raise ProgramError(message, process.returncode)
    return said[0]


def _hear(text: str, progress: Optional[Progress], complaints: list[str]) -> None:
    """Tells a line of progress, keeps a complaint, logs a note."""
    if text.startswith("progress: "):
        what, _, count = text[len("progress: ") :].rpartition(" ")
        done, _, of = count.partition("/")
        if progress is not None and done.isdecimal() and of.isdecimal():
            progress(what, int(done), int(of))
    elif text.startswith(("roomsight: ", "error: ")):
        complaints.append(text.partition(": ")[2])
    elif text:
        _log.info(text)


def flags(options: Mapping[str, Option]) -> list[str]:
    """Options as the command line has them."""
    line: list[str] = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            line.append(flag)
        elif isinstance(value, Mapping):
            line += [f"{flag}={key}={_text(item)}" for key, item in value.items()]
        elif isinstance(value, list):
            line += [f"{flag}={_text(item)}" for item in value]
        elif value is not None and value is not False:
            line.append(f"{flag}={_text(value)}")
    return line


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def executable() -> str:
    """Where the program is. Raises ``FileNotFoundError`` where there is none."""
    named = os.environ.get("ROOMSIGHT")
    beside = Path(sysconfig.get_path("scripts")) / "roomsight"
    found = named or (str(beside) if beside.is_file() else shutil.which("roomsight"))
    if found is None:
        raise FileNotFoundError("there is no program roomsight: install the wheel that `make wheel` builds, or name it in the variable ROOMSIGHT")
    return found
