"""The inbox, frames that the model doubted: what the service tells of them, and the calls."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from typing import Any, Optional

from . import calls
from .calls import Frame
from .steps import AsyncCaller, Caller, Method, Steps, ask, fetch
from .trainings import PublishedVersion
from .types import RoomProbability


@dataclass(frozen=True)
class InboxRule:
    """Which frames are kept, and how many: those of ``all`` callers, or of these ``robots`` and ``keys``.

    At most one of a robot in ``every_s`` seconds; answers below ``probability`` are doubted too. Frames are deleted after
    ``max_days``, and before that, the oldest without a label first, where there are too many.
    """

    all: bool
    robots: list[str]
    keys: list[str]
    every_s: float
    probability: float
    max_frames: int
    max_bytes: int
    max_days: int


@dataclass(frozen=True)
class InboxState(InboxRule):
    """The rule, and how much it has kept. ``missed`` frames were not, since too many came at once."""

    frames: int
    bytes: int
    missed: int


@dataclass(frozen=True)
class InboxLabel:
    """What a frame shows, and where it lies in a data set. ``by`` is the name of a key, or an address."""

    set: str
    room: str
    path: str
    by: str
    at: str


@dataclass(frozen=True)
class InboxFrame:
    """A frame that was kept: what was answered, and why that is doubted.

    ``reasons`` are ``unknown``, ``low``, ``torn``, ``filter_apart``, ``shadow_apart`` or ``wrong``; ``value`` is how much it
    would teach, 0 to 1. ``label`` is what it was labeled, ``said`` what a person says who found its answer wrong.
    """

    id: int
    at: str
    room: str
    known: bool
    probability: float
    probabilities: list[RoomProbability]
    reasons: list[str]
    value: float
    model: PublishedVersion
    revision: int
    robot: Optional[str] = None
    key: Optional[str] = None
    unknown: Optional[str] = None
    novelty: Optional[float] = None
    filtered_room: Optional[str] = None
    shadow_room: Optional[str] = None
    label: Optional[InboxLabel] = None
    said: Optional[str] = None


@dataclass(frozen=True)
class InboxList:
    """Some of ``total`` frames that were asked for; ``open`` of all have no label. ``next`` is where the others begin, None
    where these are the last."""

    total: int
    open: int
    frames: list[InboxFrame]
    next: Optional[int] = None


@dataclass(frozen=True)
class LabelConflict:
    """A frame that was not labeled: somebody else did meanwhile, or it is gone."""

    id: int
    reason: str
    label: Optional[InboxLabel] = None


@dataclass(frozen=True)
class LabeledFrames:
    """What became of labels. ``change`` is that of the data set, which can be undone; None where nothing was labeled."""

    labeled: list[InboxFrame]
    conflicts: list[LabelConflict]
    change: Optional[int] = None


@dataclass(frozen=True)
class LearningPolicy:
    """What follows from labels by itself: a training on ``set`` when ``train_after`` frames were labeled since the last one
    (0: never). A version of ``model`` that is not worse becomes what ``publish`` says: ``shadow``, ``canary``, ``stable`` or
    ``nothing``, where a person decides. ``effort`` and ``camera`` are as for ``Client.trainings.begin``."""

    set: Optional[str] = None
    model: Optional[str] = None
    train_after: int = 0
    publish: str = "nothing"
    effort: str = "default"
    camera: Optional[str] = None


@dataclass(frozen=True)
class _Discarded:
    discarded: int


class _InboxCalls:
    """The calls about the inbox."""

    @Method
    def rule(self) -> Steps[InboxState]:
        """Which frames are kept, and how many there are."""
        return ask(InboxState, "GET", "/v1/inbox/rule")

    @Method
    def set_rule(self, rule: InboxRule) -> Steps[InboxState]:
        """Keeps other frames, such as by ``dataclasses.replace(client.inbox.rule(), all=True)``."""
        body = {member.name: getattr(rule, member.name) for member in fields(InboxRule)}
        return ask(InboxState, "PUT", "/v1/inbox/rule", json=body)

    @Method
    def list(
        self,
        *,
        state: Optional[str] = None,
        reason: Optional[str] = None,
        robot: Optional[str] = None,
        room: Optional[str] = None,
        sort: Optional[str] = None,
        after: Optional[int] = None,
        limit: Optional[int] = None,
    ) -> Steps[InboxList]:
        """The frames that were kept, of a reason, a robot or an answered room, from ``after`` on.

        ``state`` is ``open`` (without a label, as where it is left out), ``labeled`` or ``all``; ``sort`` is ``value`` (what
        teaches most first, as where it is left out) or ``newest``.
        """
        query = {
            "state": state,
            "reason": reason,
            "robot": robot,
            "room": room,
            "sort": sort,
            "after": after,
            "limit": limit,
        }
        return ask(InboxList, "GET", "/v1/inbox", params=calls.given(query))

    @Method
    def picture(self, id: int, *, width: Optional[int] = None) -> Steps[bytes]:
        """The picture of a frame: a JPEG at most so wide, or the file as it came."""
        return fetch(calls.path("inbox", id, "picture"), params=calls.given({"width": width}))

    @Method
    def wrong(
        self,
        frame: Frame,
        *,
        robot: Optional[str] = None,
        right: Optional[str] = None,
        model: Optional[str] = None,
    ) -> Steps[InboxFrame]:
        """Says that a frame was answered wrong, and which room is ``right`` where that is known: it comes into the inbox."""
        query = calls.given({"robot": robot, "right": right, "model": model})
        return ask(InboxFrame, "POST", "/v1/inbox", params=query, **calls.frame_body(frame))

    @Method
    def label(
        self, frames: Iterable[InboxFrame], *, set: str, room: str, drive: Optional[str] = None
    ) -> Steps[LabeledFrames]:
        """Says what frames show, and puts them into a data set, which is made where it is not there; ``elsewhere`` is no room.

        Frames that somebody else has labeled since they were listed are told as conflicts.
        """
        body = {"set": set, "room": room, "drive": drive, "frames": _seen(frames)}
        return ask(LabeledFrames, "POST", "/v1/inbox/labels", json=calls.given(body))

    @Method
    def discard(self, frames: Iterable[InboxFrame]) -> Steps[int]:
        """Throws frames away that teach nothing, and tells how many; those that were labeled since they were listed stay."""
        return (yield from ask(_Discarded, "POST", "/v1/inbox/discard", json={"frames": _seen(frames)})).discarded

    @Method
    def policy(self) -> Steps[LearningPolicy]:
        """What follows from labels by itself."""
        return ask(LearningPolicy, "GET", "/v1/inbox/policy")

    @Method
    def set_policy(self, policy: LearningPolicy) -> Steps[LearningPolicy]:
        """Lets other things follow from labels."""
        return ask(LearningPolicy, "PUT", "/v1/inbox/policy", json=calls.given(asdict(policy)))


def _seen(frames: Iterable[InboxFrame]) -> list[dict[str, Any]]:
    """Frames as they were listed: what was changed since is not changed again."""
    return [{"id": frame.id, "revision": frame.revision} for frame in frames]


class Inbox(_InboxCalls, Caller):
    """The frames that the model doubted. ``Client.inbox``."""


class AsyncInbox(_InboxCalls, AsyncCaller):
    """The frames that the model doubted. ``AsyncClient.inbox``."""
