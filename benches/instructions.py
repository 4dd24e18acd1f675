"""Instructions a frame of each step, counted by callgrind, and the table of them in docs/BENCHMARKS.md.

    python3 benches/instructions.py            prints the table; with UPDATE=1 it writes it too
    python3 benches/instructions.py --check    fails where a step takes more than 3 % more than the table says, or where vector
                                               instructions were not compiled into the loops that use them

Counts are the same in every run, so that a few frames are enough. Another compiler counts otherwise: then nothing fails.
"""

import concurrent.futures
import datetime
import os
import re
import shutil
import subprocess
import sys

from measured import FOLDER, ONE_THREAD, ROOT, cpu, left_out, output_of, prepare, table

DOCUMENT = ROOT / "docs" / "BENCHMARKS.md"
BEGIN, END = "<!-- instructions -->\n", "<!-- end of instructions -->\n"
CAMERAS = ["perspective", "omnidirectional"]
STEPS = {
    **{step: CAMERAS for step in ("decode", "detect", "describe", "bag", "classify", "core")},
    # The camera makes no difference to these.
    **{step: CAMERAS[:1] for step in ("sift", "surf", "harris_laplace", "recall")},
}
N_FRAMES = 4
TOLERANCE = 0.03


def count(binary, step, camera):
    """Instructions a frame."""
    out = FOLDER / f"callgrind.{step}.{camera}"
    valgrind = ["valgrind", "--tool=callgrind", "--toggle-collect=*take_frame*", f"--callgrind-out-file={out}"]
    command = [*valgrind, binary, "count", FOLDER, step, camera, str(N_FRAMES)]
    done = subprocess.run(command, env={**os.environ, **ONE_THREAD}, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{step}, {camera}:\n{done.stderr}")
    return int(re.search(r"^(?:summary|totals): (\d+)", out.read_text(), re.MULTILINE)[1]) // N_FRAMES


def counted(binary):
    wanted = [(step, camera) for step, cameras in STEPS.items() for camera in cameras]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return dict(zip(wanted, pool.map(lambda one: count(binary, *one), wanted)))


def not_inlined(binary):
    """Vector instructions that are called as functions, many times slower: of closures that are compiled for any processor."""
    return sorted(set(re.findall(r"\b_mm(?:256|512)?_\w+", output_of("nm", "-C", binary))))


def circumstances():
    name, kind = cpu()
    has_changes = bool(output_of("git", "status", "--porcelain", "--untracked-files=no"))
    commit = output_of("git", "rev-parse", "--short=10", "HEAD") + (", with changes" if has_changes else "")
    return {
        "machine": f"{name} ({kind})",
        "date": datetime.date.today().isoformat(),
        "commit": commit,
        "rustc": output_of("rustc", "--version"),
        "valgrind": output_of("valgrind", "--version"),
        "command": "`make bench-instructions`",
    }


def written(counts, about):
    rows = [[step] + [f"{counts[step, camera]:,}" if camera in cameras else "" for camera in CAMERAS] for step, cameras in STEPS.items()]
    lines = [f"- {name}: {value}" for name, value in about.items()] + [""] + table(["step", *CAMERAS], rows)
    return "\n".join(lines) + "\n"


def read():
    """What the document says: the counts, and under which circumstances."""
    _, _, text = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    text, _, _ = text.partition(END)
    about = dict(re.findall(r"^- (\w+): (.*)$", text, re.MULTILINE))
    rows = re.findall(r"^\| (\w+) +\| +([\d,]+) \| +([\d,]*) +\|$", text, re.MULTILINE)
    numbers = {(step, camera): number for step, *row in rows for camera, number in zip(CAMERAS, row) if number}
    return {key: int(number.replace(",", "")) for key, number in numbers.items()}, about


def update(counts, about):
    before, begin, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    DOCUMENT.write_text(before + begin + written(counts, about) + end + after, encoding="utf-8")


def check(counts, about):
    """The exit code."""
    expected, of_table = read()
    others = [name for name in ("rustc", "machine") if of_table.get(name) != about[name]]
    # The name of the CPU makes no difference, but which loops run on it.
    kinds = [text[text.rfind("(") :] for text in (of_table.get("machine", ""), about["machine"])]
    if kinds[0] == kinds[1]:
        others = [name for name in others if name != "machine"]
    grown = False
    for key in sorted(set(expected) | set(counts)):
        if key not in expected or key not in counts:
            print(f"{' '.join(key)}: {'not in' if key in counts else 'only in'} the table of {DOCUMENT.name}")
            grown = True
            continue
        change = counts[key] / expected[key] - 1
        if abs(change) > TOLERANCE:
            print(f"{' '.join(key)}: {counts[key]:,} instructions a frame, {change:+.1%} of the {expected[key]:,} in {DOCUMENT.name}")
            grown |= change > 0
    if others:
        for name in others:
            print(f"The table is of another {name}, {of_table.get(name)}; this is {about[name]}: nothing fails.")
        return 0
    if grown:
        print("Steps take more instructions. Make them as fast as before, or say so: make bench-instructions UPDATE=1")
        return 1
    if any(counts[key] < expected[key] * (1 - TOLERANCE) for key in counts):
        print("Steps take fewer instructions. Please keep it so: make bench-instructions UPDATE=1")
    else:
        print(f"All steps take as many instructions as {DOCUMENT.name} says, within {TOLERANCE:.0%}.")
    return 0


def main():
    if not shutil.which("valgrind"):
        return left_out("counts of instructions. They take valgrind.")
    binary = prepare()
    counts, about = counted(binary), circumstances()
    if sys.argv[1:] == ["--check"]:
        called = not_inlined(binary)
        for name in called:
            print(f"{name} is called as a function, many times slower: look for a closure round it")
        sys.exit(check(counts, about) or bool(called))
    print(written(counts, about), end="")
    if os.environ.get("UPDATE") == "1":
        update(counts, about)


main()
