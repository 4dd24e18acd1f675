"""`roomsight ros` beside nodes that are not made of its parts, which publish pictures and hear the answers, on this machine alone."""

import os
import subprocess
import sys
import time
import unittest
from pathlib import Path
from typing import Any, Callable

sys.path.insert(0, str(Path(__file__).parent))

try:
    from dds_peer import DdsPeer
    from zenoh_peer import ZenohPeer
except ImportError as error:
    raise unittest.SkipTest(f"LEFT OUT: nodes of other programs are cyclonedds, eclipse-zenoh and rosbags: {error}") from error

from paths import BINARY, MODEL, PICTURES
from PIL import Image

PATIENCE_S = 60.0
FPS = 30

#: Other than those of others on this machine, most probably.
DOMAIN = 100 + os.getpid() % 100


def file_name(room: str) -> str:
    """What a room's picture is called."""
    return "".join(letter if letter.isalnum() else "_" for letter in room.lower())


def until(what: "Callable[[], Any]") -> Any:
    """Waits for something."""
    deadline = time.monotonic() + PATIENCE_S
    while not (found := what()):
        if time.monotonic() > deadline:
            raise AssertionError("it took too long")
        time.sleep(0.02)
    return found


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def level(status: Any) -> int:
    """A byte, which libraries read as a number or as bytes."""
    return status.level if isinstance(status.level, int) else status.level[0]


class OfPeers:
    """What must go with every way that messages travel."""

    peer: Any

    def start(self, *arguments: str) -> None:
        command = [BINARY, "ros", "--model", str(MODEL), "--name", "watcher", *self.peer.options, *arguments]
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "RMW_", "ZENOH_"))}
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)

    def setUp(self) -> None:
        self.addCleanup(self.peer.close)
        self.diagnostics = self.peer.subscription("/diagnostics", "DiagnosticArray")

    def answered(self, subscription: Any, stamp: int) -> Any:
        """The answer to the picture of a stamp."""
        return until(lambda: next((answer for answer in subscription.taken() if stamp_ns(answer) == stamp), None))

    def diagnosis(self, is_so: "Callable[[Any], bool]") -> Any:
        """The status of the first camera, when it is so."""
        told = lambda: next((message.status[0] for message in self.diagnostics.taken() if is_so(message.status[0])), None)  # noqa: E731
        return until(told)

    def test_pictures_are_answered_under_names_of_ros(self) -> None:
        pictures = self.peer.publisher("/front/image_raw/compressed", "CompressedImage")
        answers = self.peer.subscription("/robot1/watcher/answer", "RoomAnswer")
        self.start("--namespace", "/robot1", "--remap", "image:=/front/image_raw")
        until(pictures.is_heard)
        until(lambda: "/robot1/watcher" in self.peer.nodes())
        for number, (room, path) in enumerate(PICTURES.items()):
            stamp = (1_700_000_000 + 60 * number) * 10**9 + 7
            # The way to the answer is known after the way to the pictures: the first may be lost.
            answer = until(lambda: self.sent_and_answered(pictures, answers, path.read_bytes(), stamp))
            self.assertEqual((file_name(answer.frame_room), answer.frame_known, answer.unknown), (room, True, ""))
            self.assertEqual(answer.header.frame_id, "camera")
            self.assertGreaterEqual({file_name(of.room) for of in answer.probabilities}, set(PICTURES))
            self.assertAlmostEqual(sum(of.probability for of in answer.probabilities), 1.0, places=3)
            self.assertEqual(answer.model, str(MODEL))

    def sent_and_answered(self, pictures: Any, answers: Any, picture: bytes, stamp: int) -> Any:
        pictures.compressed(picture, stamp)
        time.sleep(0.2)
        return next((answer for answer in answers.taken() if stamp_ns(answer) == stamp), None)

    def test_of_pictures_that_come_fast_every_one_is_answered_or_superseded(self) -> None:
        pictures = self.peer.publisher("/image/compressed", "CompressedImage")
        answers = self.peer.subscription("/watcher/answer", "RoomAnswer")
        self.start()
        until(pictures.is_heard)
        files = [path.read_bytes() for path in PICTURES.values()]
        n_sent = 3 * FPS
        for number in range(n_sent):
            pictures.compressed(files[number % len(files)], time.time_ns())
            time.sleep(1 / FPS)
        status = self.diagnosis(lambda status: self.counts(status)["received"] == n_sent and self.is_settled(status))
        counts = self.counts(status)
        self.assertEqual(counts["answered"] + counts["superseded"], n_sent)
        self.assertEqual((counts["failed"], level(status)), (0, 0))
        self.assertGreater(counts["answered"], 0)
        self.assertGreater(len(answers.taken()), 0)

    def test_raw_pictures_of_two_cameras_are_answered_each_by_itself(self) -> None:
        (first, one), (second, other) = list(PICTURES.items())[:2]
        topics = {"front": (first, one), "back": (second, other)}
        publishers = {name: self.peer.publisher(f"/{name}/image", "Image") for name in topics}
        answers = {name: self.peer.subscription(f"/watcher/{name}/answer", "RoomAnswer") for name in topics}
        self.start("--transport", "raw", "--image", "front=/front/image", "--image", "back=/back/image")
        for name, (room, path) in topics.items():
            until(publishers[name].is_heard)
            image = Image.open(path).convert("L")
            for _ in range(3):
                publishers[name].raw(image.width, image.tobytes(), 42 * 10**9)
                time.sleep(0.3)
            answer = self.answered(answers[name], 42 * 10**9)
            self.assertEqual((file_name(answer.frame_room), answer.known), (room, True))

    def test_what_is_no_picture_is_told_and_costs_itself_alone(self) -> None:
        pictures = self.peer.publisher("/image/compressed", "CompressedImage")
        answers = self.peer.subscription("/watcher/answer", "RoomAnswer")
        self.start()
        until(pictures.is_heard)
        pictures.compressed(b"no picture", 1)
        status = self.diagnosis(lambda status: self.counts(status)["failed"] == 1)
        self.assertEqual(level(status), 2)
        picture = next(iter(PICTURES.values())).read_bytes()
        until(lambda: self.sent_and_answered(pictures, answers, picture, 10**9))

    @staticmethod
    def counts(status: Any) -> "dict[str, int]":
        return {value.key: int(value.value) for value in status.values}

    def is_settled(self, status: Any) -> bool:
        counts = self.counts(status)
        return counts["received"] == counts["answered"] + counts["superseded"] + counts["failed"]


class OverDds(OfPeers, unittest.TestCase):
    def setUp(self) -> None:
        self.peer = DdsPeer(DOMAIN)
        super().setUp()


class OverZenoh(OfPeers, unittest.TestCase):
    def setUp(self) -> None:
        self.peer = ZenohPeer(DOMAIN)
        super().setUp()


if __name__ == "__main__":
    unittest.main()
