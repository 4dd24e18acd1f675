"""The node, on a stand-in of rclpy: it did not run under ROS here."""

import math
import sys
import time
import unittest
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(REPOSITORY / path) for path in ("ros2/roomsight_ros", "ros2/roomsight_ros/test", "clients/python/tests")]

try:
    import stand_in
except ImportError as error:
    raise unittest.SkipTest(f"LEFT OUT: messages are made by rosbags: {error}") from error

stand_in.install()

import numpy  # noqa: E402
from PIL import Image  # noqa: E402
from roomsight_ros.node import RoomNode  # noqa: E402
from roomsight_ros.pictures import encoded  # noqa: E402
from running import RunningService  # noqa: E402

MODEL = REPOSITORY / "models" / "simulated-lab" / "1"
PICTURES = {path.stem: path for path in (MODEL / "golden").glob("*.jpeg")}
PATIENCE_S = 30.0


def file_name(room: str) -> str:
    """What a room's picture is called."""
    return "".join(letter if letter.isalnum() else "_" for letter in room.lower())


def compressed(path: Path, stamp_s: int) -> Any:
    message = stand_in.message("sensor_msgs/msg/CompressedImage")()
    message.header.stamp.sec, message.header.frame_id = stamp_s, "camera"
    message.format, message.data = "jpeg", path.read_bytes()
    return message


def raw(path: Path, stamp_s: int, encoding: str = "bgr8") -> Any:
    pixels = numpy.asarray(Image.open(path).convert("RGB"))[:, :, ::-1]
    message = stand_in.message("sensor_msgs/msg/Image")()
    message.header.stamp.sec, message.encoding = stamp_s, encoding
    message.height, message.width, message.step = pixels.shape[0], pixels.shape[1], pixels.shape[1] * 3 + 5
    message.data = numpy.pad(pixels.reshape(message.height, -1), ((0, 0), (0, 5))).tobytes()
    return message


class Nodes(RunningService):
    def node(self, **parameters: Any) -> RoomNode:
        stand_in.Node.parameters = parameters
        node = RoomNode()
        self.addCleanup(node.destroy_node)
        return node

    def answers(self, node: RoomNode, n_answers: int) -> "list[Any]":
        published = node.publishers_by_topic["~/answer"].published
        deadline = time.monotonic() + PATIENCE_S
        while len(published) < n_answers and time.monotonic() < deadline:
            time.sleep(0.01)
        return published

    def diagnosis(self, node: RoomNode) -> "tuple[Any, dict[str, str]]":
        node.timers[0]()
        status = node.publishers_by_topic["/diagnostics"].published[-1].status[0]
        return status, {value.key: value.value for value in status.values}

    def drive(self, node: RoomNode, made: Any) -> None:
        """Every picture of the model is answered with its room, by stamps a minute apart."""
        [(kind, receive, qos)] = node.subscribed.values()
        self.assertEqual((qos.depth, qos.history, qos.reliability), (1, "keep_last", "best_effort"))
        for number, (room, path) in enumerate(sorted(PICTURES.items())):
            receive(made(path, 1_700_000_000 + 60 * number))
            answer = self.answers(node, number + 1)[number]
            self.assertEqual((file_name(answer.frame_room), answer.frame_known), (room, True))
            self.assertEqual(answer.header.stamp.sec, 1_700_000_000 + 60 * number)
            self.assertGreaterEqual({file_name(of.room) for of in answer.probabilities}, set(PICTURES))
            self.assertAlmostEqual(sum(of.probability for of in answer.probabilities), 1.0, places=4)
            self.assertTrue(0.0 <= answer.novelty <= 1.0 or math.isnan(answer.novelty))
        status, counts = self.diagnosis(node)
        self.assertEqual((status.level, counts["answered"]), (status.OK, str(len(PICTURES))))
        self.assertEqual((counts["failed"], counts["superseded"]), ("0", "0"))

    def test_a_model_in_this_process_answers_packed_pictures(self) -> None:
        self.drive(self.node(model=str(MODEL)), compressed)

    def test_a_model_in_this_process_answers_pixels(self) -> None:
        self.drive(self.node(model=str(MODEL), transport="raw"), raw)

    def test_a_service_answers_and_knows_the_robot(self) -> None:
        node = self.node(url=self.url, robot="wall-e")
        self.drive(node, compressed)
        self.assertTrue(self.answers(node, 1)[0].model.startswith("simulated-lab/"))

    def test_while_one_is_looked_at_the_latest_waits(self) -> None:
        node = self.node(model=str(MODEL))
        [(_, receive, _)] = node.subscribed.values()
        path = PICTURES["corridor"]
        for number in range(50):
            receive(compressed(path, number + 1))
        deadline = time.monotonic() + PATIENCE_S
        while self.answers(node, 1)[-1].header.stamp.sec != 50 and time.monotonic() < deadline:
            time.sleep(0.01)
        _, counts = self.diagnosis(node)
        self.assertEqual(int(counts["answered"]) + int(counts["superseded"]), 50)
        self.assertGreater(int(counts["superseded"]), 0)

    def test_what_is_no_picture_is_told_and_the_next_is_answered(self) -> None:
        for parameters in ({"model": str(MODEL)}, {"url": self.url}):
            node = self.node(**parameters)
            [(_, receive, _)] = node.subscribed.values()
            broken = compressed(PICTURES["corridor"], 1)
            broken.data = b"no picture"
            receive(broken)
            deadline = time.monotonic() + PATIENCE_S
            while not node.logger.warnings and time.monotonic() < deadline:
                time.sleep(0.01)
            status, counts = self.diagnosis(node)
            self.assertEqual((status.level, counts["failed"]), (status.ERROR, "1"))
            receive(compressed(PICTURES["corridor"], 2))
            self.assertEqual(self.answers(node, 1)[0].header.stamp.sec, 2)

    def test_what_was_sensed_when_a_picture_was_taken_goes_with_it(self) -> None:
        for parameters in ({"model": str(MODEL)}, {"url": self.url}):
            node = self.node(laser=True, odometry=True, **parameters)
            self.assertEqual(sorted(node.subscribed), ["image/compressed", "odom", "scan"])
            asked: "list[Any]" = []
            answer = node._answerer.answer

            def hear(picture: bytes, at_ns: int, senses: Any) -> Any:
                asked.append(senses)
                return answer(picture, at_ns, senses)

            node._answerer.answer = hear  # type: ignore[method-assign]
            for tenth in range(30):
                scan = stand_in.message("sensor_msgs/msg/LaserScan")()
                scan.header.stamp.sec, scan.header.stamp.nanosec = 100 + tenth // 10, tenth % 10 * 10**8
                scan.angle_min, scan.angle_increment, scan.range_max = -1.5, 0.01, 8.0
                scan.ranges = [1.0 + tenth] * 300
                node.subscribed["scan"][1](scan)
                odometry = stand_in.message("nav_msgs/msg/Odometry")()
                odometry.header.stamp = scan.header.stamp
                odometry.pose.pose.position.x = float(tenth)
                odometry.pose.pose.orientation.z = odometry.pose.pose.orientation.w = math.sqrt(0.5)
                node.subscribed["odom"][1](odometry)
            for stamp_s in (101, 200):
                node.subscribed["image/compressed"][1](compressed(PICTURES["corridor"], stamp_s))
                self.answers(node, len(asked) + 1)
            self.assertEqual([len(self.answers(node, 2)), len(asked)], [2, 2])
            self.assertEqual((asked[0].scan.ranges[0], asked[0].odometry.x), (11.0, 10.0))
            self.assertAlmostEqual(asked[0].odometry.heading, math.pi / 2)
            self.assertEqual((asked[1].scan, asked[1].odometry), (None, None), "a minute later")

    def test_parameters_that_make_no_sense_are_refused(self) -> None:
        for parameters in ({}, {"model": "a", "url": "http://b"}, {"model": str(MODEL), "transport": "smoke"}):
            stand_in.Node.parameters = parameters
            self.assertRaises(ValueError, RoomNode)

    def test_pixels_are_read_row_by_row(self) -> None:
        message = stand_in.message("sensor_msgs/msg/Image")()
        message.height, message.width, message.step, message.encoding = 2, 1, 4, "rgb8"
        message.data = bytes([1, 2, 3, 99, 4, 5, 6, 99])
        self.assertEqual(encoded(message), b"P6\n1 2\n255\n\x01\x02\x03\x04\x05\x06")
        message.encoding = "bgr8"
        self.assertEqual(encoded(message), b"P6\n1 2\n255\n\x03\x02\x01\x06\x05\x04")
        message.encoding, message.step = "mono8", 0
        self.assertEqual(encoded(message), b"P5\n1 2\n255\n\x01\x02")
        message.height = 9
        self.assertRaises(ValueError, encoded, message)
        message.encoding = "16UC1"
        self.assertRaisesRegex(ValueError, "compressed", encoded, message)


if __name__ == "__main__":
    unittest.main()
