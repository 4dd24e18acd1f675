"""What the scripts beside it measure with: one binary, and a folder of frames and models that it has prepared."""

import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "target" / "bench"
# One thread, whatever the library.
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS")}


def left_out(what):
    print(f"LEFT OUT: {what}", file=sys.stderr, flush=True)


def prepare(*what):
    """Builds the binary and lets it prepare the folder; the binary's path."""
    command = "cargo build --release -p roomsight-bench --bin roomsight-bench --message-format=json-render-diagnostics"
    built = subprocess.run(command.split(), cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    executable = next(filter(None, (json.loads(line).get("executable") for line in built.splitlines())))
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    # A copy: another build may come while it measures.
    binary = Path(shutil.copy2(executable, FOLDER / "roomsight-bench"))
    print("rendering frames and training on them", file=sys.stderr, flush=True)
    subprocess.run([binary, "prepare", FOLDER, *what], check=True)
    return binary


def output_of(*command):
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def cpu():
    """The CPU's name, and which loops run on it as far as they are told apart here."""
    facts = {}
    if os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            lines = (line.partition(":") for line in file)
            facts = {name.strip(): value.strip() for name, _, value in lines}
    has_avx2 = "avx2" in facts.get("flags", "").split()
    return facts.get("model name", "unknown"), platform.machine() + (", AVX2" if has_avx2 else "")


def table(head, rows):
    """Lines of a table in Markdown, the first column to the left."""
    cells = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    widths = [max(len(row[idx]) for row in cells) for idx in range(len(head))]

    def line(row):
        first, *others = (cell.rjust(width) if idx else cell.ljust(width) for idx, (cell, width) in enumerate(zip(row, widths)))
        return "| " + " | ".join([first, *others]) + " |"

    return [line(row) for row in cells]
