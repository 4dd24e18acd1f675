"""The messages of a stream, ``roomsight.v1``: what is sent and received, apart from any socket."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any, Optional, Union
from urllib.parse import urlencode

from .errors import Problem, ProtocolError, ResumePoint
from .senses import Beside
from .types import Answer, Filtered, ModelName, decode

SUBPROTOCOL = "roomsight.v1"

#: What begins a frame that has a number: magic, flags, number, time in ns since 1970; all little-endian.
_HEADER = struct.Struct("<4sIQQ")
_DATED, _LOCATED, _SCANNED = 1, 2, 4

#: What follows it where odometry is told.
_ODOMETRY = struct.Struct("<ddd")


@dataclass(frozen=True)
class FilterSettings:
    """How much one frame counts in the filter, above 0 to 10: lower is steadier and later.

    A stream that says nothing of it has 2.0.
    """

    trust: float


@dataclass(frozen=True)
class StreamSettings:
    """How a stream is configured."""

    model: str
    mode: str
    robot: Optional[str] = None
    interval_ms: Optional[int] = None
    sure_interval_ms: Optional[int] = None
    filter: Optional[FilterSettings] = None
    deadline_ms: Optional[int] = None
    top: Optional[int] = None
    explain: bool = False


@dataclass(frozen=True)
class StreamLimits:
    """What a stream is limited to."""

    max_frame_bytes: int
    max_frame_pixels: int
    window: int
    idle_timeout_ms: int
    resume_ms: int
    message_timeout_ms: Optional[int] = None


@dataclass(frozen=True)
class Hello:
    """The first message of a connection.

    ``session`` and ``resume`` are secrets: who has one can go on with the stream. ``stream`` is the name that dashboards show.
    ``filter`` is ``kept`` or ``reset`` where the stream goes on that another service had.
    """

    protocol: str
    session: str
    resumed: bool
    next_seq: int
    settings: StreamSettings
    limits: StreamLimits
    modes: list[str]
    model: ModelName
    rooms: list[str]
    stream: Optional[str] = None
    filter: Optional[str] = None
    resume: Optional[str] = None


@dataclass(frozen=True)
class Configured:
    """The stream is configured so from the next frame on."""

    settings: StreamSettings


@dataclass(frozen=True)
class Notice:
    """Something about the stream that its robot's developer should know; each is told once a stream.

    ``kind`` is ``stamps`` where the frames' times of capture stand still, run backwards, are zero or leap: the
    filter then goes by the times at which frames arrive.
    """

    kind: str
    detail: str


@dataclass(frozen=True)
class Result:
    """Which room a frame shows: ``answer`` is the frame's own, ``filtered`` that of the stream.

    ``age_ms`` is from capture to answer, where the frame was dated by a clock within an hour of the service's.
    """

    seq: int
    answer: Answer
    filtered: Optional[Filtered] = None
    age_ms: Optional[float] = None
    notice: Optional[Notice] = None
    resume: Optional[str] = None

    @property
    def room(self) -> str:
        """The room to act on: the filter's where there is one."""
        return (self.filtered or self.answer).room

    @property
    def known(self) -> bool:
        """Whether to act on ``room``: as the filter says where there is one."""
        return (self.filtered or self.answer).known

    @property
    def probability(self) -> float:
        """The probability of ``room``."""
        return (self.filtered or self.answer).probability


@dataclass(frozen=True)
class Dropped:
    """A frame was not looked at: ``superseded``, ``deadline``, ``draining``, ``overload`` (never in ``lossless``), or ``lost``
    with the service that had it."""

    seq: int
    reason: str


@dataclass(frozen=True)
class Error:
    """A frame could not be used, or, without ``seq``, a message that is no frame. The stream lives on."""

    problem: Problem
    seq: Optional[int] = None


@dataclass(frozen=True)
class ModelChanged:
    """From ``first_seq`` on, another model answers. ``filter`` is ``kept`` or ``reset``."""

    to: ModelName
    epoch: int
    first_seq: int
    filter: str
    rooms: list[str]


@dataclass(frozen=True)
class Draining:
    """The service stops: frames are no longer read."""


#: What ``receive`` gives.
Message = Union[Hello, Configured, Result, Dropped, Error, ModelChanged, Draining]

_KINDS: dict[str, Any] = {
    "hello": Hello,
    "configured": Configured,
    "dropped": Dropped,
    "error": Error,
    "model_changed": ModelChanged,
    "draining": Draining,
}


def read_message(text: Union[str, bytes]) -> Message:
    """What the service says. Raises ``ProtocolError``."""
    try:
        data = json.loads(text)
    except ValueError as error:
        raise ProtocolError(f"a message is no JSON: {error}") from error
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "result":
        # The answer's fields stand beside those of the result.
        return decode(Result, {**data, "answer": data})
    if kind not in _KINDS:
        raise ProtocolError(f"an unknown message: {str(text)[:200]}")
    message: Message = decode(_KINDS[kind], data)
    return message


def frame_message(frame: bytes, seq: int, beside: Beside) -> bytes:
    """A frame as it is sent: with a header where there is something to tell of it, else bare."""
    return frame if beside.is_nothing else numbered_message(frame, seq, beside)


def numbered_message(frame: bytes, seq: int, beside: Beside) -> bytes:
    """A frame with a header, and the scan of a laser between them where there is one."""
    captured_at_ns, odometry, scan = beside.captured_at_ns, beside.odometry, beside.scan
    flags = _DATED * (captured_at_ns is not None) | _LOCATED * (odometry is not None) | _SCANNED * (scan is not None)
    message = _HEADER.pack(b"RSF1", flags, seq, captured_at_ns or 0)
    if odometry is not None:
        message += _ODOMETRY.pack(odometry.x, odometry.y, odometry.heading)
    if scan is not None:
        message += scan.as_bytes()
    return message + frame


def resume_query(point: ResumePoint) -> dict[str, Any]:
    """What in the address of a stream lets it go on."""
    return {
        "session": point.session,
        "last_seq": point.last_seq,
        "sent_seq": point.sent_seq,
        "resume": point.resume,
    }


def configure_message(settings: dict[str, Any]) -> str:
    """The message that changes a stream. What is None stays as it is."""
    given = {name: value for name, value in settings.items() if value is not None}
    return json.dumps({"type": "configure", **given})


def stream_url(url: str, query: dict[str, Any]) -> str:
    """The address of a stream at the service ``url``."""
    given = {name: value for name, value in query.items() if value is not None}
    base = url.rstrip("/").replace("http", "ws", 1)
    return f"{base}/v1/stream" + (f"?{urlencode(given)}" if given else "")


#: What of a stream's settings stands in its address.
IN_ADDRESS = ("robot", "model", "mode", "interval_ms", "sure_interval_ms")


def begin_query(settings: dict[str, Any], point: Optional[ResumePoint]) -> dict[str, Any]:
    """The query of a stream that is configured so, or goes on from a point."""
    in_address = {name: settings.get(name) for name in IN_ADDRESS}
    return in_address if point is None else {**in_address, **resume_query(point)}


def not_in_address(settings: dict[str, Any]) -> dict[str, Any]:
    """The settings that are told once the stream has begun."""
    return {name: value for name, value in settings.items() if value is not None and name not in IN_ADDRESS}


class Position:
    """What both kinds of streams know of theirs: the next number, the last answer, and how the stream stood then."""

    def __init__(self, hello: Hello, resumed_from: Optional[ResumePoint]) -> None:
        self.next_seq = hello.next_seq
        self._session = hello.session
        self._last_seq = resumed_from.last_seq if resumed_from and hello.resumed else None
        self._resume = hello.resume

    @property
    def point(self) -> ResumePoint:
        """Where the stream can go on."""
        sent_seq = self.next_seq - 1 if self.next_seq else None
        return ResumePoint(self._session, self._last_seq, sent_seq, self._resume)

    def number(self) -> int:
        """The number of the frame that is about to be sent."""
        self.next_seq += 1
        return self.next_seq - 1

    def read(self, text: Union[str, bytes]) -> Message:
        """What the service says; the last answer is kept in mind."""
        message = read_message(text)
        if isinstance(message, (Result, Dropped, Error)) and message.seq is not None:
            self._last_seq = message.seq
        if isinstance(message, Result) and message.resume is not None:
            self._resume = message.resume
        return message
