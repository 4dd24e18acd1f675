"""A small stand-in of rclpy and of the messages that the node uses, where ROS is not installed.

Messages are made of their definitions, those of ROS as the package rosbags has them and those of roomsight as they lie in
``roomsight_msgs``: they have the fields of these, each set to its default, and no other.
"""

import sys
import time
import types
from pathlib import Path
from typing import Any, Callable

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MESSAGES = Path(__file__).resolve().parents[2] / "roomsight_msgs" / "msg"
NUMBERS = {"bool": False, "string": "", "float32": 0.0, "float64": 0.0}


def _types() -> "dict[str, Any]":
    store = get_typestore(Stores.ROS2_HUMBLE)
    for path in sorted(MESSAGES.glob("*.msg"), reverse=True):
        store.register(get_types_from_msg(path.read_text(), f"roomsight_msgs/msg/{path.stem}"))
    return store.fielddefs


def _default(kind: Any, made: "Callable[[str], type]") -> Any:
    node, detail = kind
    if node == Nodetype.NAME:
        return made(detail)()
    if node == Nodetype.BASE:
        return NUMBERS.get(detail[0], 0)
    return bytes() if detail[0] == (Nodetype.BASE, ("uint8", 0)) else []


def _message_classes() -> "Callable[[str], type]":
    definitions, classes = _types(), {}

    def made(name: str) -> type:
        if name not in classes:
            constants, fields = definitions[name]

            def __init__(self: Any) -> None:
                for field, kind in fields:
                    setattr(self, field, _default(kind, made))

            # As in ROS: a field that is not defined cannot be set.
            attributes = {"__slots__": [field for field, _ in fields], "__init__": __init__}
            attributes.update({constant: value for constant, _, value in constants})
            classes[name] = type(name.rsplit("/", 1)[1], (), attributes)
        return classes[name]

    return made


class Clock:
    def now(self) -> Any:
        nanoseconds = time.time_ns()
        stamp = message("builtin_interfaces/msg/Time")()
        stamp.sec, stamp.nanosec = divmod(nanoseconds, 10**9)
        return types.SimpleNamespace(nanoseconds=nanoseconds, to_msg=lambda: stamp)


class Publisher:
    def __init__(self) -> None:
        self.published: "list[Any]" = []

    def publish(self, message: Any) -> None:
        self.published.append(message)


class Logger:
    def __init__(self) -> None:
        self.warnings: "list[str]" = []

    def warning(self, text: str, *, throttle_duration_sec: float = 0.0) -> None:
        self.warnings.append(text)


class Node:
    #: Of the next node.
    parameters: "dict[str, Any]" = {}

    def __init__(self, name: str) -> None:
        self._name, self._values = name, {}
        self.publishers_by_topic: "dict[str, Publisher]" = {}
        self.subscribed: "dict[str, tuple[type, Callable[[Any], None], Any]]" = {}
        self.timers: "list[Callable[[], None]]" = []
        self.logger = Logger()

    def declare_parameter(self, name: str, default: Any) -> None:
        self._values[name] = self.parameters.get(name, default)

    def get_parameter(self, name: str) -> Any:
        return types.SimpleNamespace(value=self._values[name])

    def create_publisher(self, kind: type, topic: str, qos: Any) -> Publisher:
        return self.publishers_by_topic.setdefault(topic, Publisher())

    def create_subscription(self, kind: type, topic: str, callback: "Callable[[Any], None]", qos: Any) -> None:
        self.subscribed[topic] = (kind, callback, qos)

    def create_timer(self, period_s: float, callback: "Callable[[], None]") -> None:
        self.timers.append(callback)

    def get_clock(self) -> Clock:
        return Clock()

    def get_logger(self) -> Logger:
        return self.logger

    def get_name(self) -> str:
        return self._name

    def get_fully_qualified_name(self) -> str:
        return f"/{self._name}"

    def destroy_node(self) -> None:
        pass


message = _message_classes()


def install() -> None:
    """Makes what the node imports."""

    def module(name: str, **content: Any) -> None:
        sys.modules[name] = types.ModuleType(name)
        sys.modules[name].__dict__.update(content)

    def messages(package: str, *names: str) -> None:
        module(package)
        module(f"{package}.msg", **{name: message(f"{package}/msg/{name}") for name in names})

    def profile(**settings: Any) -> Any:
        return types.SimpleNamespace(**settings)

    module("rclpy", init=None, spin=None, try_shutdown=None)
    module("rclpy.node", Node=Node)
    module(
        "rclpy.qos",
        QoSProfile=profile,
        HistoryPolicy=types.SimpleNamespace(KEEP_LAST="keep_last"),
        ReliabilityPolicy=types.SimpleNamespace(BEST_EFFORT="best_effort"),
    )
    messages("diagnostic_msgs", "DiagnosticArray", "DiagnosticStatus", "KeyValue")
    messages("roomsight_msgs", "RoomAnswer", "RoomProbability")
    messages("sensor_msgs", "CompressedImage", "Image", "LaserScan")
    messages("nav_msgs", "Odometry")
