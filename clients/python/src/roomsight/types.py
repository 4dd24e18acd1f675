"""What the service answers, as typed values, and how they come out of JSON."""

from __future__ import annotations

import dataclasses
import functools
import typing
from dataclasses import dataclass, field
from typing import Any, Callable, Optional, TypeVar

from .errors import ProtocolError

T = TypeVar("T")

_JSON_NAME = "json_name"


@dataclass(frozen=True)
class RoomProbability:
    """A room and its probability, 0 to 1."""

    room: str
    probability: float


@dataclass(frozen=True)
class ModelName:
    """The model that answered. ``epoch`` is the model's when this version came to serve."""

    name: str
    version: int
    epoch: int
    digest: str


@dataclass(frozen=True)
class Timings:
    """Where the time of a frame went, in milliseconds."""

    queue: float
    decode: float
    features: float
    classify: float


@dataclass(frozen=True)
class KeypointEvidence:
    """How much one keypoint, at column ``x`` and row ``y`` of the frame, spoke for the room, as an opinion saw it."""

    x: float
    y: float
    opinion: str
    weight: float
    word: Optional[int] = None
    frame: Optional[str] = None


@dataclass(frozen=True)
class NearestFrame:
    """A training frame that is like the frame, as an opinion sees both; ``nearness`` 1 is the same. ``points`` are the keypoints
    of the frame that found it, as column and row."""

    opinion: str
    frame: str
    drive: str
    room: str
    nearness: float
    points: list[list[float]] = field(default_factory=list)


@dataclass(frozen=True)
class FramePose:
    """Where a frame was taken, in meters and radians, ``radius`` meters more or less."""

    x: float
    y: float
    angle: float
    radius: float


@dataclass(frozen=True)
class Answer:
    """Which room a frame shows. Do not act on the room where ``known`` is false.

    ``unknown`` says why: ``unsure``, ``new_place``, ``no_detail``, ``dark`` or ``covered``. ``novelty``, from 0 to 1, is how
    probable a place is that was never trained, ``None`` where the model cannot tell.
    """

    room: str
    known: bool
    probability: float
    probabilities: list[RoomProbability]
    model: ModelName
    keypoints: int
    timings_ms: Timings
    request_id: str
    robot: Optional[str] = None
    captured_at: Optional[str] = None
    evidence: Optional[list[KeypointEvidence]] = None
    damaged_rows: int = 0
    unknown: Optional[str] = None
    novelty: Optional[float] = None
    nearest: Optional[list[NearestFrame]] = None
    pose: Optional[FramePose] = None


@dataclass(frozen=True)
class Filtered:
    """What the frames of a stream say together. Do not act on the room where ``known`` is false."""

    room: str
    probability: float
    probabilities: list[RoomProbability]
    known: bool = False
    novelty: Optional[float] = None


@dataclass(frozen=True)
class Network:
    """A network that a model looks through: its ONNX file has ``bytes`` bytes and the digest ``blake3``."""

    name: str
    blake3: str
    bytes: int


@dataclass(frozen=True)
class StateChange:
    """When (RFC 3339) another state came to be true of a version."""

    state: str
    at: str


@dataclass(frozen=True)
class Failure:
    """Why a version does not serve: what was wrong while ``verifying``, ``loading`` or ``warming``."""

    stage: str
    reason: str


@dataclass(frozen=True)
class Shadow:
    """How a shadow compares with the stable version, in frames. ``mean_distance`` is that of their probabilities, from
    0 (equal) to 1."""

    compared: int
    agreed: int
    skipped: int
    mean_distance: Optional[float] = None


@dataclass(frozen=True)
class Version:
    """One version of a model. ``rooms`` are those that it tells apart; ``networks`` are empty where it needs none.

    ``history`` are its last states, the oldest first; ``share`` is a canary's. ``card`` tells how it was trained, where
    ``Client.version`` asks for it.
    """

    version: int
    state: str
    labels: list[str]
    epoch: Optional[int] = None
    digest: Optional[str] = None
    rooms: Optional[list[str]] = None
    networks: list[Network] = field(default_factory=list)
    history: list[StateChange] = field(default_factory=list)
    failure: Optional[Failure] = None
    share: Optional[float] = None
    shadow: Optional[Shadow] = None
    card: Optional[dict[str, Any]] = None


@dataclass(frozen=True)
class Model:
    """A model: its versions, the highest first, and the one that serves; ``default`` where it answers requests that
    name none. ``epoch`` tells how often what serves was changed, ``settled`` the highest version that ever had a label."""

    name: str
    versions: list[Version]
    serving: Optional[int] = None
    default: bool = False
    epoch: int = 0
    settled: int = 0


@dataclass(frozen=True)
class FrameCounts:
    """What became of a robot's frames; ``dropped`` by reason."""

    accepted: int
    results: int
    errors: int
    dropped: dict[str, int]


@dataclass(frozen=True)
class PastAnswer:
    """An answer of ``ago_s`` seconds ago."""

    seq: int
    room: str
    probability: float
    timings_ms: Timings
    ago_s: float
    known: bool = False


@dataclass(frozen=True)
class Robot:
    """A robot that streams or sends requests; its room is the filter's where there is one, and one to act on where
    ``known``. ``lost``: its answers have been unknown for too long. ``stream``, ``mode`` and ``streaming_s`` are None
    where it sends requests. ``frame`` is the number of its last frame, where the service keeps it; ``ribbon`` where it was in the last ten
    minutes: ``room``, ``known``, and ``from`` and ``until`` as RFC 3339. ``service`` is where a robot of another service is."""

    id: str
    via: str
    connected: bool
    last_seen_s: float
    lost: bool
    frames_per_s: float
    frames: FrameCounts
    answers: list[PastAnswer]
    robot: Optional[str] = None
    stream: Optional[str] = None
    service: Optional[str] = None
    mode: Optional[str] = None
    streaming_s: Optional[float] = None
    key: Optional[str] = None
    room: Optional[str] = None
    known: bool = False
    unknown: Optional[str] = None
    novelty: Optional[float] = None
    probability: Optional[float] = None
    probabilities: list[RoomProbability] = field(default_factory=list)
    in_room_s: Optional[float] = None
    lost_s: Optional[float] = None
    age_ms: Optional[float] = None
    latency_ms: Optional[float] = None
    frame: Optional[int] = None
    model: Optional[ModelName] = None
    ribbon: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class RobotList:
    """All robots, in the order of their ids."""

    robots: list[Robot]


@dataclass(frozen=True)
class ModelList:
    """All models, and the one that answers where none is asked for."""

    models: list[Model]
    default: Optional[str] = None


def named(name: str, default: Any = dataclasses.MISSING) -> Any:
    """A field whose name in JSON is another one, such as a word of Python."""
    return field(default=default, metadata={_JSON_NAME: name})


def decode(kind: type[T], data: Any) -> T:
    """A value of a dataclass from parsed JSON. Fields that it does not have are left out.

    Raises ``ProtocolError`` where a field is missing.
    """
    if not isinstance(data, dict):
        raise ProtocolError(f"{kind.__name__} is no object: {data!r}")
    one: Any = kind
    known = {name: read(data[in_json]) for name, in_json, read in _members(one) if in_json in data}
    try:
        return kind(**known)
    except TypeError as error:
        raise ProtocolError(f"{kind.__name__} cannot be read: {error}") from error


@functools.lru_cache(maxsize=None)
def _members(kind: Any) -> list[tuple[str, str, Callable[[Any], Any]]]:
    """Of each field of a dataclass its name, its name in JSON, and what reads it: found once, since hints are text until then."""
    hints = typing.get_type_hints(kind)
    fields = dataclasses.fields(kind)
    return [(field.name, field.metadata.get(_JSON_NAME, field.name), _reader(hints[field.name])) for field in fields]


def _reader(hint: Any) -> Callable[[Any], Any]:
    """What reads a value of this hint."""
    arguments, origin = typing.get_args(hint), typing.get_origin(hint)
    if origin is typing.Union:
        read = _reader(arguments[0])
        return lambda value: None if value is None else read(value)
    if origin is list:
        read_item = _reader(arguments[0])
        return lambda value: None if value is None else [read_item(item) for item in value]
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return lambda value: None if value is None else decode(hint, value)
    return lambda value: value
