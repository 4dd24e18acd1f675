"""What a service tells as it happens, and how its lines are read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Optional, Union

from .errors import ProtocolError
from .types import ModelName, RoomProbability, decode, named


@dataclass(frozen=True)
class AnswerEvent:
    """A frame was answered: of a stream, or a single one, which has no ``stream``. The room is the filter's where there is one."""

    room: str
    known: bool
    probability: float
    probabilities: list[RoomProbability]
    latency_ms: float
    robot: Optional[str] = None
    stream: Optional[str] = None
    novelty: Optional[float] = None


@dataclass(frozen=True)
class RobotJoined:
    """A robot's stream began, or was resumed."""

    stream: str
    robot: Optional[str] = None


@dataclass(frozen=True)
class RobotLeft:
    """A robot's connection ended; its stream can be resumed for a while."""

    stream: str
    robot: Optional[str] = None


@dataclass(frozen=True)
class ServingChanged:
    """Another version of a model serves."""

    to: ModelName


@dataclass(frozen=True)
class SwapFailed:
    """Another version of a model was to serve (``change``: activate, rollback, latest, label or unload), and does not."""

    model: str
    change: str
    reason: str


@dataclass(frozen=True)
class RobotLost:
    """A robot's answers have been unknown for too long, since ``since`` (RFC 3339)."""

    id: str
    since: str
    robot: Optional[str] = None
    stream: Optional[str] = None


@dataclass(frozen=True)
class RobotFound:
    """A robot that was lost for ``lost_s`` seconds is in a room again."""

    id: str
    room: str
    lost_s: float
    robot: Optional[str] = None
    stream: Optional[str] = None


@dataclass(frozen=True)
class RoomChanged:
    """A robot's known answers name another room; ``before`` is None where they named none yet."""

    id: str
    to: str
    robot: Optional[str] = None
    stream: Optional[str] = None
    before: Optional[str] = named("from", None)


@dataclass(frozen=True)
class TrainingChanged:
    """A training began or ended: ``state`` is as in ``Training``."""

    id: int
    model: str
    state: str


@dataclass(frozen=True)
class InboxChanged:
    """Frames came into the inbox, got labels, or went: ``open`` have no label now."""

    open: int


@dataclass(frozen=True)
class SetChanged:
    """A data set was changed."""

    set: str


@dataclass(frozen=True)
class Lost:
    """This reader was too slow: so many of the oldest events are gone."""

    events: int


@dataclass(frozen=True)
class OtherEvent:
    """What services of later versions tell."""

    kind: str
    data: dict[str, Any]


Event = Union[
    AnswerEvent,
    RobotJoined,
    RobotLeft,
    ServingChanged,
    SwapFailed,
    RobotLost,
    RobotFound,
    RoomChanged,
    TrainingChanged,
    InboxChanged,
    SetChanged,
    Lost,
    OtherEvent,
]

_KINDS: dict[str, type[Any]] = {
    "answer": AnswerEvent,
    "robot_joined": RobotJoined,
    "robot_left": RobotLeft,
    "model_changed": ServingChanged,
    "swap_failed": SwapFailed,
    "robot_lost": RobotLost,
    "robot_found": RobotFound,
    "room_changed": RoomChanged,
    "training": TrainingChanged,
    "inbox_changed": InboxChanged,
    "set_changed": SetChanged,
    "lost": Lost,
}


def read_event(line: str) -> Optional[Event]:
    """The event of a line of ``text/event-stream``; None of a line without one. The service sends each in one line of data.

    Raises ``ProtocolError``."""
    if not line.startswith("data:"):
        return None
    try:
        data = json.loads(line[len("data:") :])
        kind = data.pop("type")
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise ProtocolError(f"an event cannot be read: {line[:200]}") from error
    known = _KINDS.get(kind)
    event: Event = OtherEvent(str(kind), data) if known is None else decode(known, data)
    return event
