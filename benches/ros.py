"""What a frame costs over DDS, over zenoh and over the WebSocket, at 30 pictures a second of one camera: CPU time of the program that
answers, and the age of the answers. `PYTHONPATH=clients/python/src ROOMSIGHT=target/release/roomsight target/python/bin/python
benches/ros.py FOLDER`, with a folder of pictures.
"""

import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "crates/ros/tests/peers"))

from dds_peer import DdsPeer  # noqa: E402
from paths import BINARY, MODEL, REPOSITORY  # noqa: E402
from roomsight import Client  # noqa: E402
from zenoh_peer import ZenohPeer  # noqa: E402

FPS, SECONDS, ROUNDS = 30, 20, 3
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def cpu_s(process: "subprocess.Popen[bytes]") -> float:
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def paced(pictures: "list[bytes]", send: Any, seconds: float = SECONDS) -> int:
    """Sends pictures at their rate; returns how many."""
    start, number = time.monotonic(), 0
    while (due := start + number / FPS) < start + seconds:
        time.sleep(max(0.0, due - time.monotonic()))
        send(pictures[number % len(pictures)], time.time_ns())
        number += 1
    return number


def over_ros(peer: Any, pictures: "list[bytes]") -> "tuple[float, int, list[float]]":
    publisher = peer.publisher("/image/compressed", "CompressedImage")
    answers = peer.subscription("/roomsight/answer", "RoomAnswer")
    process = subprocess.Popen([BINARY, "ros", "--model", str(MODEL), *peer.options], **QUIET)
    try:
        while not publisher.is_heard():
            time.sleep(0.1)
        paced(pictures, publisher.compressed, 3)
        time.sleep(1)
        answers.taken()
        ages: "list[float]" = []
        is_done = threading.Event()

        def hear() -> None:
            while not is_done.wait(0.001):
                now = time.time_ns()
                ages.extend((now - message.header.stamp.sec * 10**9 - message.header.stamp.nanosec) / 1e6 for message in answers.taken())

        hearing = threading.Thread(target=hear)
        hearing.start()
        before = cpu_s(process)
        n_sent = paced(pictures, publisher.compressed)
        time.sleep(0.5)
        used = cpu_s(process) - before
        is_done.set()
        hearing.join()
        return used / n_sent * 1e3, n_sent, ages
    finally:
        process.terminate()
        process.wait()
        peer.close()


def over_websocket(pictures: "list[bytes]") -> "tuple[float, int, list[float]]":
    listen = "127.0.0.1:18087"
    arguments = ["--models", str(REPOSITORY / "models"), "--listen", listen, "--set", "log_level=error"]
    process = subprocess.Popen([BINARY, "serve", *arguments], **QUIET)
    try:
        client = Client(f"http://{listen}")
        while True:
            try:
                stream = client.lasting_stream(robot="bench", filter=True)
                break
            except OSError:
                time.sleep(0.1)
        ages: "list[float]" = []

        def hear() -> None:
            while True:
                try:
                    ending = stream.answer()
                except Exception:
                    return
                if getattr(ending, "age_ms", None) is not None:
                    ages.append(ending.age_ms)

        threading.Thread(target=hear, daemon=True).start()

        def send(picture: bytes, at_ns: int) -> None:
            stream.send(picture, captured_at_ns=at_ns)

        paced(pictures, send, 3)
        time.sleep(1)
        ages.clear()
        before = cpu_s(process)
        n_sent = paced(pictures, send)
        time.sleep(0.5)
        used = cpu_s(process) - before
        return used / n_sent * 1e3, n_sent, ages
    finally:
        process.terminate()
        process.wait()


def main() -> None:
    pictures = [path.read_bytes() for path in sorted(Path(sys.argv[1]).rglob("*.jpeg"))[:64]]
    ways = {
        "websocket": lambda: over_websocket(pictures),
        "dds": lambda: over_ros(DdsPeer(101), pictures),
        "zenoh": lambda: over_ros(ZenohPeer(102), pictures),
    }
    told: "dict[str, list[Any]]" = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            told[name].append(way())
    base = statistics.median(cpu for cpu, _, _ in told["websocket"])
    for name, rounds in told.items():
        cpu = statistics.median(cpu for cpu, _, _ in rounds)
        ages = sorted(age for _, _, ages in rounds for age in ages)
        n_sent = sum(n_sent for _, n_sent, _ in rounds)
        p99 = ages[len(ages) * 99 // 100]
        print(f"{name}: {n_sent} sent, {len(ages)} answered, CPU {cpu:.2f} ms a frame ({cpu / base:.2f}), age p50 {ages[len(ages) // 2]:.1f} ms, p99 {p99:.1f} ms")


if __name__ == "__main__":
    main()
