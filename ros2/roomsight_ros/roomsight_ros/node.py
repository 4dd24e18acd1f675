"""The node: pictures in, rooms out. While one is looked at, of those that come only the latest waits."""

from __future__ import annotations

import math
import threading
from typing import Any, Optional, Union

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry as OdometryMessage
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from roomsight_msgs.msg import RoomAnswer, RoomProbability
from roomsight import Odometry, Scan
from sensor_msgs.msg import CompressedImage, Image, LaserScan

from .answerers import ModelAnswerer, ServiceAnswerer, Told
from .pictures import encoded
from .senses import Recent, Senses, odometry_of, scan_of, stamp_ns

#: As cameras publish: what is lost is old.
LATEST = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)

#: Scans and odometry come faster than pictures: some wait for theirs.
RECENT = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

#: How many answers may wait for a subscriber.
DEPTH = 10

DIAGNOSTICS_S = 1.0

#: Without a picture for so long, something is wrong.
SILENCE_S = 5.0

Answerer = Union[ModelAnswerer, ServiceAnswerer]


class RoomNode(Node):
    """Answers the pictures of one camera."""

    def __init__(self) -> None:
        super().__init__("roomsight")
        for name, default in (("model", ""), ("url", ""), ("key", ""), ("robot", ""), ("transport", "compressed"), ("trust", -1.0), ("laser", False), ("odometry", False)):
            self.declare_parameter(name, default)
        self._answerer = self._made_answerer()
        self._waiting: Optional[Any] = None
        self._is_closed = False
        self._changed = threading.Condition()
        self._counts = {"received": 0, "answered": 0, "superseded": 0, "dropped": 0, "failed": 0}
        self._problem = ""
        self._last_ns = self.get_clock().now().nanoseconds
        self._last: Optional[RoomAnswer] = None
        self._answers = self.create_publisher(RoomAnswer, "~/answer", DEPTH)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEPTH)
        transport = self._parameter("transport")
        if transport not in ("compressed", "raw"):
            raise ValueError(f"transport is compressed or raw, not {transport}")
        kind, topic = (Image, "image") if transport == "raw" else (CompressedImage, "image/compressed")
        self.create_subscription(kind, topic, self._receive, LATEST)
        self._scans: Recent[Scan] = Recent()
        self._odometry: Recent[Odometry] = Recent()
        if self._parameter("laser"):
            self.create_subscription(LaserScan, "scan", self._keep_scan, RECENT)
        if self._parameter("odometry"):
            self.create_subscription(OdometryMessage, "odom", self._keep_odometry, RECENT)
        self.create_timer(DIAGNOSTICS_S, self._diagnose)
        self._thread = threading.Thread(target=self._answer_all, name="answers", daemon=True)
        self._thread.start()

    def _parameter(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _made_answerer(self) -> Answerer:
        model, url, trust = self._parameter("model"), self._parameter("url"), self._parameter("trust")
        if bool(model) == bool(url):
            raise ValueError("give one of the parameters model, the folder of a model, and url, the address of a service")
        trust = None if trust < 0 else trust
        if model:
            return ModelAnswerer(model, trust)
        return ServiceAnswerer(url, self._parameter("key") or None, self._parameter("robot") or self.get_name(), trust)

    def _receive(self, message: Any) -> None:
        with self._changed:
            self._counts["received"] += 1
            self._counts["superseded"] += self._waiting is not None
            self._waiting = message
            self._last_ns = self.get_clock().now().nanoseconds
            self._changed.notify()

    def _keep_scan(self, message: Any) -> None:
        self._scans.add(stamp_ns(message), scan_of(message))

    def _keep_odometry(self, message: Any) -> None:
        self._odometry.add(stamp_ns(message), odometry_of(message))

    def _answer_all(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting is not None or self._is_closed)
                if self._is_closed:
                    return
                message, self._waiting = self._waiting, None
            at_ns = stamp_ns(message)
            try:
                senses = Senses(self._scans.at(at_ns), self._odometry.at(at_ns))
                told = self._answerer.answer(encoded(message), at_ns, senses)
            except Exception as error:  # A picture costs itself alone, whatever is wrong with it.
                self._count("failed", str(error))
                # Each second at most, by the clock of the node.
                self.get_logger().warning(f"a picture is not answered: {error}", throttle_duration_sec=1.0)
                continue
            if told is None:
                self._count("dropped", "the service is too busy for all pictures")
                continue
            answer = self._message(message, told)
            self._count("answered", "")
            self._last = answer
            self._answers.publish(answer)

    def _count(self, ending: str, problem: str) -> None:
        with self._changed:
            self._counts[ending] += 1
            self._problem = problem

    @staticmethod
    def _message(picture: Any, told: Told) -> RoomAnswer:
        answer = RoomAnswer()
        answer.header = picture.header
        answer.room, answer.known = told.filtered.room, told.filtered.known
        answer.probability = told.filtered.probability
        answer.frame_room, answer.frame_known = told.single.room, told.single.known
        answer.frame_probability = told.single.probability
        answer.unknown = told.single.unknown or ""
        answer.novelty = math.nan if told.single.novelty is None else told.single.novelty
        for of_room in told.filtered.probabilities:
            probability = RoomProbability()
            probability.room, probability.probability = of_room.room, of_room.probability
            answer.probabilities.append(probability)
        answer.model = told.model
        return answer

    def _diagnose(self) -> None:
        with self._changed:
            counts, problem, last_ns = dict(self._counts), self._problem, self._last_ns
        silence_s = (self.get_clock().now().nanoseconds - last_ns) / 1e9
        status = DiagnosticStatus()
        status.name, status.hardware_id = f"{self.get_fully_qualified_name()}: room", ""
        if problem:
            status.level, status.message = DiagnosticStatus.ERROR, problem
        elif silence_s > SILENCE_S:
            status.level, status.message = DiagnosticStatus.WARN, f"no picture for {silence_s:.0f} s"
        else:
            room = self._last.room if self._last and self._last.known else "not known"
            status.level, status.message = DiagnosticStatus.OK, f"room: {room}"
        for name, count in counts.items():
            value = KeyValue()
            value.key, value.value = name, str(count)
            status.values.append(value)
        diagnostics = DiagnosticArray()
        diagnostics.header.stamp = self.get_clock().now().to_msg()
        diagnostics.status.append(status)
        self._diagnostics.publish(diagnostics)

    def destroy_node(self) -> None:
        """Ends the answering, and the stream to a service."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join()
        self._answerer.close()
        super().destroy_node()


def main() -> None:
    """Runs the node until it is stopped."""
    rclpy.init()
    node = RoomNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
