"""What polite callers get beside a greedy one, which posts frames over many connections and never waits.

Run it as `python3 benches/fairness.py [CONNECTIONS ...]`, after `cargo build --release`; it needs wrk. Beside the
greedy caller run a caller with 5 frames a second over REST, one with 5 frames a second over a stream, one with a batch
of 16 frames a second, and one that asks /livez ten times a second. ROOMSIGHT names another binary, SECONDS how long a
row takes [15]. Prints the rows of a table in Markdown.
"""

import base64
import collections
import http.client
import json
import os
import re
import socket
import struct
import subprocess
import sys
import threading
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
ROOMSIGHT = os.environ.get("ROOMSIGHT", ROOT + "/target/release/roomsight")
SECONDS = int(os.environ.get("SECONDS", "15"))
PORT = 18411
FRAME_FILE = ROOT + "/models/simulated-lab/1/golden/corridor.jpeg"
with open(FRAME_FILE, "rb") as file:
    FRAME = file.read()
PART = b'--x\r\ncontent-disposition: form-data; name="frame"\r\n\r\n' + FRAME + b"\r\n"
BATCH = PART * 16 + b"--x--\r\n"


class Caller(threading.Thread):
    """Calls at a steady rate and notes the milliseconds of what was answered."""

    def __init__(self, per_second):
        super().__init__(daemon=True)
        self.interval, self.answered, self.asked, self.stop = 1 / per_second, [], 0, False

    def run(self):
        self.open()
        due = time.monotonic()
        while not self.stop:
            began = time.monotonic()
            self.asked += 1
            if self.call():
                self.answered.append((time.monotonic() - began) * 1e3)
            due = max(due + self.interval, time.monotonic())
            time.sleep(due - time.monotonic() if due > time.monotonic() else 0)

    def row(self):
        if not self.answered:
            return f"0 of {self.asked}"
        answered = sorted(self.answered)
        at = lambda share: answered[min(len(answered) - 1, int(len(answered) * share))]
        return f"{len(answered)} of {self.asked}, {at(.5):.1f} / {at(.99):.1f}"


class Http(Caller):
    def __init__(self, per_second, method, path, body=None, media_type="image/jpeg"):
        super().__init__(per_second)
        self.request = method, path, body, {"Content-Type": media_type}

    def open(self):
        self.connection = http.client.HTTPConnection("127.0.0.1", PORT, timeout=60)

    def call(self):
        self.connection.request(*self.request)
        response = self.connection.getresponse()
        body = response.read()
        return response.status == 200 and b'"error"' not in body


class Stream(Caller):
    def open(self):
        self.socket = socket.create_connection(("127.0.0.1", PORT), timeout=60)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET /v1/stream?robot=polite-stream HTTP/1.1\r\nHost: 127.0.0.1:{PORT}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n".encode()
        )
        self.file = self.socket.makefile("rb")
        while self.file.readline() != b"\r\n":
            pass
        self.read()

    def call(self):
        # A mask of zeros leaves the bytes as they are.
        self.socket.sendall(struct.pack("!BBQI", 0x82, 0xFF, len(FRAME), 0) + FRAME)
        return self.read()["type"] == "result"

    def read(self):
        """The next text message."""
        while True:
            kind, length = self.file.read(2)
            if length == 126:
                (length,) = struct.unpack("!H", self.file.read(2))
            elif length == 127:
                (length,) = struct.unpack("!Q", self.file.read(8))
            message = self.file.read(length)
            if kind & 15 == 1:
                return json.loads(message)


def measure(n_connections):
    callers = [
        Http(5, "POST", "/v1/recognize?robot=polite", FRAME),
        Stream(5),
        Http(1, "POST", "/v1/recognize/batch?robot=batches", BATCH, "multipart/form-data; boundary=x"),
        Http(10, "GET", "/livez"),
    ]
    for caller in callers:
        caller.start()
    time.sleep(1)
    if n_connections:
        url = f"http://127.0.0.1:{PORT}/v1/recognize?robot=greedy"
        command = ["wrk", "-t1", f"-c{n_connections}", f"-d{SECONDS}s", "--timeout", "20s"]
        script = ROOT + "/benches/greedy.lua"
        environment = {**os.environ, "FRAME": FRAME_FILE}
        done = subprocess.run([*command, "-s", script, url], capture_output=True, text=True, env=environment)
        told = re.search(r"answered (\d+) refused (\d+) other (\d+)", done.stdout)
        n_answered, n_refused, n_other = (int(number) / SECONDS for number in told.groups())
        greedy = f"{n_answered:.0f} answered, {n_refused:.0f} refused, {n_other:.0f} other"
    else:
        greedy = ""
        time.sleep(SECONDS)
    for caller in callers:
        caller.stop = True
    for caller in callers:
        caller.join()
    print(f"| {n_connections} | {greedy} | " + " | ".join(caller.row() for caller in callers) + " |", flush=True)


def main():
    listen = f"127.0.0.1:{PORT}"
    command = [ROOMSIGHT, "serve", "--models", ROOT + "/models", "--listen", listen, "--set", "log_level=warn"]
    service = subprocess.Popen(command)
    try:
        while subprocess.run([ROOMSIGHT, "health", "http://" + listen], capture_output=True).returncode:
            time.sleep(0.1)
        print("| greedy connections | greedy frames/s | REST, p50 / p99 ms | stream | batches of 16 | /livez |")
        print("|---|---|---|---|---|---|")
        for n_connections in map(int, sys.argv[1:] or ["0", "8", "64", "128", "400"]):
            measure(n_connections)
    finally:
        service.terminate()
        service.wait()


main()
