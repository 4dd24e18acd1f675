"""A node over zenoh, by the names that rmw_zenoh has for things, and the router that nodes meet at."""

import socket
import threading
from typing import Any

import numpy
import zenoh
from rosbags.typesys import Stores, get_typestore, get_types_from_msg

from paths import REPOSITORY

TYPES = get_typestore(Stores.ROS2_JAZZY)
for path in sorted((REPOSITORY / "ros2/roomsight_msgs/msg").glob("*.msg")):
    TYPES.register(get_types_from_msg(path.read_text(), f"roomsight_msgs/msg/{path.stem}"))

KINDS = {
    "CompressedImage": "sensor_msgs/msg/CompressedImage",
    "Image": "sensor_msgs/msg/Image",
    "RoomAnswer": "roomsight_msgs/msg/RoomAnswer",
    "DiagnosticArray": "diagnostic_msgs/msg/DiagnosticArray",
}

#: A number, a time, and 16 bytes of the publisher behind their length.
N_ATTACHED = 33


class ZenohPeer:
    """Publishes pictures, hears answers."""

    def __init__(self, domain: int) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            router = f"tcp/127.0.0.1:{free.getsockname()[1]}"
        self.options = ["--over", "zenoh", "--router", router, "--domain", str(domain)]
        self._domain = domain
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", f'["{router}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        self._session = zenoh.open(config)

    def key(self, topic: str, kind: str) -> str:
        package, name = KINDS[kind].split("/msg/")
        return f"{self._domain}{topic}/{package}::msg::dds_::{name}_/{TYPES.hash_rihs01(KINDS[kind])}"

    def tokens(self) -> "list[list[str]]":
        """What nodes say that they have, in the parts of their keys."""
        replies = self._session.liveliness().get(f"@ros2_lv/{self._domain}/**")
        return [str(reply.ok.key_expr).split("/") for reply in replies if reply.ok]

    def publisher(self, topic: str, kind: str) -> "ZenohPublisher":
        return ZenohPublisher(self, topic, kind, self._session.declare_publisher(self.key(topic, kind)))

    def subscription(self, topic: str, kind: str) -> "ZenohSubscription":
        subscription = ZenohSubscription(KINDS[kind])
        subscription.declared = self._session.declare_subscriber(self.key(topic, kind), subscription.receive)
        return subscription

    def nodes(self) -> "set[str]":
        """What nodes say that they are called."""
        told = [parts for parts in self.tokens() if parts[5] == "NN"]
        return {f"{parts[7].replace('%', '/').rstrip('/')}/{parts[8]}" for parts in told}

    def close(self) -> None:
        self._session.close()


class ZenohPublisher:
    def __init__(self, peer: ZenohPeer, topic: str, kind: str, publisher: Any) -> None:
        self._peer, self._kind, self._publisher = peer, KINDS[kind], publisher
        self._mangled, self._hash = topic.replace("/", "%"), TYPES.hash_rihs01(self._kind)

    def is_heard(self) -> bool:
        is_known = any(parts[5] == "MS" and parts[9] == self._mangled and parts[11] == self._hash for parts in self._peer.tokens())
        return is_known and self._publisher.matching_status.matching

    def compressed(self, picture: bytes, stamp_ns: int) -> None:
        self._publish(header=header(stamp_ns), format="jpeg", data=numpy.frombuffer(picture, numpy.uint8))

    def raw(self, width: int, pixels: bytes, stamp_ns: int) -> None:
        data = numpy.frombuffer(pixels, numpy.uint8)
        self._publish(header=header(stamp_ns), height=len(pixels) // width, width=width, encoding="mono8", is_bigendian=0, step=width, data=data)

    def _publish(self, **fields: Any) -> None:
        message = TYPES.types[self._kind](**fields)
        self._publisher.put(bytes(TYPES.serialize_cdr(message, self._kind)))


class ZenohSubscription:
    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._lock = threading.Lock()
        self._received: "list[Any]" = []
        self.declared: Any = None

    def receive(self, sample: Any) -> None:
        assert len(bytes(sample.attachment)) == N_ATTACHED
        message = TYPES.deserialize_cdr(bytes(sample.payload), self._kind)
        with self._lock:
            self._received.append(message)

    def taken(self) -> "list[Any]":
        with self._lock:
            taken, self._received = self._received, []
        return taken


def header(stamp_ns: int) -> Any:
    stamp = TYPES.types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return TYPES.types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera")
