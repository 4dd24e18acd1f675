"""CPU time of a frame and its steps beside other libraries, in turn, round after round, each on the same one core.

    python3 benches/compare.py [PYTHON]

PYTHON is one with the packages of PEERS in the Makefile; what it lacks is left out. ROUNDS: of which the medians are printed
[15; a fifth of it for what takes seconds]. Times are the CPU time of the thread that works. Ratios are of medians within this run:
on a machine that others use as well, trust them and no single time.
"""

import json
import os
import statistics
import subprocess
import sys

from measured import FOLDER, ONE_THREAD, ROOT, cpu, left_out, output_of, prepare, table

ROUNDS = int(os.environ.get("ROUNDS", "15"))
CAMERAS = ["perspective", "omnidirectional"]
ALL, FEW = 1000, 3
# What is measured (its step here, the peer's, the camera, over how many frames), and what the two are called.
FRAMES = [
    *(("whole", None, camera, ALL, "whole: JPEG to probabilities", "") for camera in CAMERAS),
    *(("core", "turbo", camera, ALL, "core: luma to probabilities", "libjpeg-turbo, luma decode") for camera in CAMERAS),
    *(("decode", "turbo", camera, ALL, "decode", "libjpeg-turbo, luma decode") for camera in CAMERAS),
    ("fast_20", "fast_20", "perspective", ALL, "FAST, threshold 20", "OpenCV FAST, threshold 20"),
    ("fast_8", "fast_8", "perspective", ALL, "FAST, threshold 8", "OpenCV FAST, threshold 8"),
    ("detect", "fast_8", "perspective", ALL, "detect: the 300 strongest from 8 on", "OpenCV FAST, threshold 8"),
    ("detect", "fast_20", "perspective", ALL, "detect: the 300 strongest from 8 on", "OpenCV FAST, threshold 20"),
]
SLOW = [
    ("sift", "sift", "perspective", FEW, "SIFT", "OpenCV SIFT"),
    ("surf", None, "perspective", FEW, "SURF", ""),
    ("harris_laplace", "harris_laplace", "perspective", FEW, "Harris-Laplace, SIFT", "OpenCV Harris-Laplace, SIFT"),
    ("recall", None, "perspective", ALL, "memory of 320,000: recall", ""),
    ("k_means", "k_means", "-", 1, "k-means, 100,000 x 72 to 300, 20 rounds", "faiss"),
    ("svm", "svm", "-", 1, "SVM, RBF, one for each pair of rooms", "LIBSVM"),
]


class Worker:
    """A process that answers a line with a line."""

    def __init__(self, *command):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "bufsize": 1}
        self.process = subprocess.Popen(command, env={**os.environ, **ONE_THREAD}, **pipes)

    def ask(self, step, camera, n_frames):
        self.process.stdin.write(f"{step} {camera} {n_frames}\n")
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"{step}: no answer")
        return json.loads(answer)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


class Peers:
    """Answers each step from a process of its own: what one library loads slows others down."""

    def __init__(self, *command):
        self.command = command
        self.workers = {}

    def ask(self, step, camera, n_frames):
        if step not in self.workers:
            self.workers[step] = Worker(*self.command)
        return self.workers[step].ask(step, camera, n_frames)

    def close(self):
        for worker in self.workers.values():
            worker.close()


def measure(rows, n_rounds, ours, theirs):
    """The answers of all rounds, by worker and question. The first round only warms up."""
    answers = {}
    for idx in range(n_rounds + 1):
        print(f"round {idx} of {n_rounds}", file=sys.stderr, flush=True)
        asked = dict.fromkeys(
            (worker, (step, camera, n_frames))
            for own_step, peer_step, camera, n_frames, *_ in rows
            for worker, step in ((ours, own_step), (theirs, peer_step))
            if worker and step
        )
        for worker, question in asked:
            answer = worker.ask(*question)
            if idx:
                answers.setdefault((worker, question), []).append(answer)
    return answers


def row(answers, ours, theirs, own_step, peer_step, camera, n_frames, name, peer):
    own = answers[ours, (own_step, camera, n_frames)]
    others = answers.get((theirs, (peer_step, camera, n_frames)), [])
    start = [name, camera, f"{median(own):.3f}"]
    if not others or "missing" in others[0]:
        return [*start, "", "", "", ""]
    ratio = f"{median(own) / median(others):.2f}"
    return [*start, peer, f"{median(others):.3f}", ratio, found(own[0], others[0])]


def median(answers):
    return statistics.median(answer["ms"] for answer in answers)


def found(own, other):
    """What both found, if they say."""
    for name in ("inertia", "support_vectors"):
        if name in other:
            return f"{name.replace('_', ' ')} {own[name]:.6g} and {other[name]:.6g}"
    if not other.get("found"):
        return ""
    same = ", the same" if (own["found"], own["places"]) == (other["found"], other["places"]) else ""
    return f"{own['found']} and {other['found']} keypoints{same}"


def pin():
    """This process and those that it starts run on one core."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def main():
    binary = prepare("training")
    python = sys.argv[1] if len(sys.argv) > 1 else None
    pin()
    ours = Worker(binary, "time", FOLDER)
    theirs = Peers(python, ROOT / "benches" / "peers.py", FOLDER) if python else None
    lines = []
    for rows, n_rounds in ((FRAMES, ROUNDS), (SLOW, max(1, ROUNDS // 5))):
        answers = measure(rows, n_rounds, ours, theirs)
        missing = {answer[0]["missing"] for answer in answers.values() if "missing" in answer[0]}
        for package in sorted(missing):
            left_out(f"what {package} is compared with.")
        lines += [row(answers, ours, theirs, *one) for one in rows]
    for worker in filter(None, (ours, theirs)):
        worker.close()
    print(f"{', '.join(cpu())}; {output_of('rustc', '--version')}; medians of {ROUNDS} and {max(1, ROUNDS // 5)} rounds")
    head = ["CPU milliseconds a frame, or in all", "camera", "ours", "peer", "theirs", "ours / theirs", "found"]
    print("\n".join(table(head, lines)))


main()
