"""A node that CycloneDDS is."""

import os
from typing import Any

LOOPBACK = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>
<Discovery><Peers><Peer address="127.0.0.1"/></Peers><ParticipantIndex>auto</ParticipantIndex></Discovery>
</Domain></CycloneDDS>"""
os.environ["CYCLONEDDS_URI"] = LOOPBACK

import idl  # noqa: E402
from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402

#: As ROS 2 encodes messages.
PLAIN = Policy.DataRepresentation(use_cdrv0_representation=True)
CAMERA = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1), PLAIN)
RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(100), PLAIN)
LATE_TOO = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal, Policy.History.KeepLast(1), PLAIN)

KINDS = {"CompressedImage": idl.CompressedImage_, "Image": idl.Image_, "RoomAnswer": idl.RoomAnswer_, "DiagnosticArray": idl.DiagnosticArray_}


class DdsPeer:
    """Publishes pictures, hears answers."""

    def __init__(self, domain: int) -> None:
        self.options = ["--over", "dds", "--localhost", "--domain", str(domain)]
        self._participant = DomainParticipant(domain)
        self._nodes = DataReader(self._participant, self._topic("ros_discovery_info", idl.ParticipantEntitiesInfo_), qos=LATE_TOO)

    def _topic(self, name: str, kind: Any) -> Topic:
        return Topic(self._participant, name, kind)

    def publisher(self, topic: str, kind: str) -> "DdsPublisher":
        return DdsPublisher(DataWriter(self._participant, self._topic(f"rt{topic}", KINDS[kind]), qos=CAMERA))

    def subscription(self, topic: str, kind: str) -> "DdsSubscription":
        return DdsSubscription(DataReader(self._participant, self._topic(f"rt{topic}", KINDS[kind]), qos=RELIABLE))

    def nodes(self) -> "set[str]":
        """What nodes say that they are called."""
        told = [node for message in self._nodes.read(N=100) for node in message.node_entities_info_seq]
        return {f"{node.node_namespace.rstrip('/')}/{node.node_name}" for node in told}

    def close(self) -> None:
        """It goes with its last reference."""


class DdsPublisher:
    def __init__(self, writer: DataWriter) -> None:
        self._writer = writer

    def is_heard(self) -> bool:
        return bool(self._writer.get_matched_subscriptions())

    def compressed(self, picture: bytes, stamp_ns: int) -> None:
        self._writer.write(idl.CompressedImage_(header(stamp_ns), "jpeg", picture))

    def raw(self, width: int, pixels: bytes, stamp_ns: int) -> None:
        self._writer.write(idl.Image_(header(stamp_ns), len(pixels) // width, width, "mono8", 0, width, pixels))


class DdsSubscription:
    def __init__(self, reader: DataReader) -> None:
        self._reader = reader

    def taken(self) -> "list[Any]":
        return list(self._reader.take(N=100))


def header(stamp_ns: int) -> Any:
    return idl.Header_(idl.Time_(stamp_ns // 10**9, stamp_ns % 10**9), "camera")
