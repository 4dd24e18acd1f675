"""What a service tells as it happens, and how its lines are read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Optional, Union

from .errors import ProtocolError
from .types import ModelName, RoomProbability, decode


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
class Lost:
    """This reader was too slow: so many of the oldest events are gone."""

    events: int


@dataclass(frozen=True)
class OtherEvent:
    """What services of later versions tell."""

    kind: str
    data: dict[str, Any]


Event = Union[AnswerEvent, RobotJoined, RobotLeft, ServingChanged, Lost, OtherEvent]

_KINDS: dict[str, type[Any]] = {
    "answer": AnswerEvent,
    "robot_joined": RobotJoined,
    "robot_left": RobotLeft,
    "model_changed": ServingChanged,
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
