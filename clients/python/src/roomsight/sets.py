"""Data sets, which rooms are taught with: what the service tells of them, and the calls."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Optional, Union

from . import calls
from .calls import Frame
from .steps import AsyncCaller, Caller, Method, Steps, ask, fetch, tell

#: How many frames one request brings, and about how many bytes at most.
_FRAMES_AT_ONCE = 16
_BYTES_AT_ONCE = 32 << 20
_MEDIA_TYPE = "application/octet-stream"


@dataclass(frozen=True)
class SetSummary:
    """A data set in a line; ``frames`` of no room are counted too. ``changed_at`` is as of RFC 3339."""

    name: str
    rooms: int
    frames: int
    bytes: int
    changed_at: Optional[str] = None


@dataclass(frozen=True)
class SetList:
    """The data sets there are, by name."""

    sets: list[SetSummary]


@dataclass(frozen=True)
class SetDrive:
    """A drive through a room; one without a name holds the frames that lie in the room's folder itself."""

    name: str
    frames: int


@dataclass(frozen=True)
class SetRoom:
    """A room of a data set, with its drives by name."""

    name: str
    frames: int
    drives: list[SetDrive]


@dataclass(frozen=True)
class LeftOutFile:
    """A file of a data set's folder that is no frame."""

    path: str
    reason: str


@dataclass(frozen=True)
class SetChange:
    """A change of a data set. ``by`` is the name of a key, or an address; ``frames`` how many it touched.

    ``action`` is ``add``, ``label``, ``move``, ``remove``, ``rename_room``, ``rename_drive`` or ``remove_room``.
    """

    id: int
    at: str
    by: str
    action: str
    text: str
    frames: int
    undone: bool


@dataclass(frozen=True)
class DataSet:
    """A data set; its room ``elsewhere``, the pictures of no room, comes last.

    ``advice`` is what is missing for a good training, the gravest first; ``changes`` are the last, the newest first.
    """

    name: str
    bytes: int
    rooms: list[SetRoom]
    advice: list[str]
    left_out: list[LeftOutFile]
    changes: list[SetChange]


@dataclass(frozen=True)
class SetFrame:
    """A frame of a data set, which its path there names."""

    path: str
    room: str
    drive: str
    bytes: int


@dataclass(frozen=True)
class FrameList:
    """Some of ``total`` frames, by path; ``next`` is where the others begin, None where these are the last."""

    total: int
    frames: list[SetFrame]
    next: Optional[str] = None


@dataclass(frozen=True)
class CopiedFrame:
    """A picture that is in the data set already, at ``path``."""

    name: str
    path: str


@dataclass(frozen=True)
class RefusedFrame:
    """A picture that was not taken."""

    name: str
    reason: str


@dataclass(frozen=True)
class AddedFrames:
    """What became of frames that were sent: ``added`` are the paths of those that were taken. ``changes`` took them, and can
    be undone, the last one first."""

    added: list[str] = field(default_factory=list)
    copies: list[CopiedFrame] = field(default_factory=list)
    refused: list[RefusedFrame] = field(default_factory=list)
    changes: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class SetFinding:
    """A frame that is odd: ``heading`` says what that means and what to do. ``other`` is the frame that it is a copy of,
    ``likely_room`` the one that it shows more likely."""

    oddity: str
    heading: str
    path: str
    room: str
    detail: str = ""
    other: Optional[str] = None
    likely_room: Optional[str] = None


@dataclass(frozen=True)
class SetCheck:
    """What is odd in a data set, the gravest first. ``state`` is ``none``, ``running``, ``done`` or ``failed``."""

    state: str
    at: Optional[str] = None
    error: Optional[str] = None
    n_frames: Optional[int] = None
    findings: list[SetFinding] = field(default_factory=list)


@dataclass(frozen=True)
class _Added:
    """The answer to one request with frames."""

    added: list[str]
    copies: list[CopiedFrame]
    refused: list[RefusedFrame]
    change: Optional[int] = None


@dataclass(frozen=True)
class _NamedFrame:
    name: str
    content: bytes


#: A class with a method `list` cannot say so.
_Summaries = list[SetSummary]


class _SetCalls:
    """The calls about data sets; `set` is the name of one."""

    @Method
    def list(self) -> Steps[_Summaries]:
        """The data sets there are."""
        return (yield from ask(SetList, "GET", "/v1/sets")).sets

    @Method
    def create(self, set: str) -> Steps[SetSummary]:
        """Makes a data set, or finds the one that is there."""
        return ask(SetSummary, "PUT", calls.path("sets", set))

    @Method
    def remove(self, set: str) -> Steps[None]:
        """Removes a data set. The service keeps its frames for a while."""
        return tell("DELETE", calls.path("sets", set))

    @Method
    def show(self, set: str) -> Steps[DataSet]:
        """One data set, with its rooms and its last changes."""
        return ask(DataSet, "GET", calls.path("sets", set))

    @Method
    def frames(
        self,
        set: str,
        *,
        room: Optional[str] = None,
        drive: Optional[str] = None,
        after: Optional[str] = None,
        limit: Optional[int] = None,
    ) -> Steps[FrameList]:
        """The frames of a data set, of a room or of a drive, from ``after`` on, which is the ``next`` of those before."""
        query = {"room": room, "drive": drive, "after": after, "limit": limit}
        return ask(FrameList, "GET", calls.path("sets", set, "frames"), params=calls.given(query))

    @Method
    def picture(self, set: str, path: str, *, width: Optional[int] = None) -> Steps[bytes]:
        """The picture of a frame: a JPEG at most so wide, or the file as it is."""
        return fetch(calls.path("sets", set, "picture"), params=calls.given({"path": path, "width": width}))

    @Method
    def add_frames(
        self, set: str, frames: Union[Frame, Iterable[Frame]], *, room: str, drive: Optional[str] = None
    ) -> Steps[AddedFrames]:
        """Adds pictures to a room, which is made where it is not there; ``elsewhere`` is no room.

        What is no picture, or is there already, is told and left out: by its path, or by its place among ``frames``, from 0 on.
        Many frames take several requests. Where one fails, those before it stay; sent again, their frames are copies.
        """
        result = AddedFrames()
        for batch in _batches(_named(frames)):
            # They are numbered, since the names of files in forms cannot have all characters.
            names = {str(idx): frame.name for idx, frame in enumerate(batch)}
            form = [("frame", (number, frame.content, _MEDIA_TYPE)) for number, frame in zip(names, batch)]
            url, query = calls.path("sets", set, "frames"), calls.given({"room": room, "drive": drive})
            added = yield from ask(_Added, "POST", url, params=query, files=form, timeout=calls.UPLOAD_PATIENCE_S)
            result.added.extend(added.added)
            result.copies.extend(replace(copy, name=names.get(copy.name, copy.name)) for copy in added.copies)
            result.refused.extend(replace(refused, name=names.get(refused.name, refused.name)) for refused in added.refused)
            result.changes.extend([] if added.change is None else [added.change])
        return result

    @Method
    def move(self, set: str, frames: Iterable[str], *, room: str, drive: Optional[str] = None) -> Steps[SetChange]:
        """Lets frames, named by their paths, show another room; without a ``drive`` each keeps its own."""
        return self._change(set, {"action": "move", "frames": [*frames], "room": room, "drive": drive})

    @Method
    def remove_frames(self, set: str, frames: Iterable[str]) -> Steps[SetChange]:
        """Removes frames, named by their paths."""
        return self._change(set, {"action": "remove", "frames": [*frames]})

    @Method
    def rename_room(self, set: str, room: str, to: str) -> Steps[SetChange]:
        """Gives a room another name; where there is a room of that name, both become one."""
        return self._change(set, {"action": "rename_room", "room": room, "to": to})

    @Method
    def rename_drive(self, set: str, room: str, drive: str, to: str) -> Steps[SetChange]:
        """Gives a drive another name; where there is a drive of that name, both become one."""
        return self._change(set, {"action": "rename_drive", "room": room, "drive": drive, "to": to})

    @Method
    def remove_room(self, set: str, room: str) -> Steps[SetChange]:
        """Removes all frames of a room."""
        return self._change(set, {"action": "remove_room", "room": room})

    def _change(self, set: str, change: dict[str, Any]) -> Steps[SetChange]:
        return ask(SetChange, "POST", calls.path("sets", set, "changes"), json=calls.given(change))

    @Method
    def undo(self, set: str, change: int) -> Steps[SetChange]:
        """Undoes a change. It is ``Refused`` where later changes stand in the way."""
        return ask(SetChange, "POST", calls.path("sets", set, "changes", change, "undo"))

    @Method
    def begin_check(self, set: str) -> Steps[SetCheck]:
        """Looks for what is odd in a data set; ``show_check`` tells what was found."""
        return ask(SetCheck, "POST", calls.path("sets", set, "check"))

    @Method
    def show_check(self, set: str) -> Steps[SetCheck]:
        """What the last look at a data set has found so far."""
        return ask(SetCheck, "GET", calls.path("sets", set, "check"))


def _named(frames: Any) -> Iterator[_NamedFrame]:
    """One picture or several, and how to tell them apart. They are read one by one."""
    is_one = isinstance(frames, (bytes, str, os.PathLike)) or hasattr(frames, "__array_interface__")
    for idx, frame in enumerate([frames] if is_one else frames):
        name = os.fspath(frame) if isinstance(frame, (str, os.PathLike)) else str(idx)
        yield _NamedFrame(name, calls.frame_bytes(frame))


def _batches(frames: Iterator[_NamedFrame]) -> Iterator[list[_NamedFrame]]:
    """Frames as requests may bring them."""
    batch: list[_NamedFrame] = []
    n_bytes = 0
    for frame in frames:
        if batch and (len(batch) == _FRAMES_AT_ONCE or n_bytes + len(frame.content) > _BYTES_AT_ONCE):
            yield batch
            batch, n_bytes = [], 0
        batch.append(frame)
        n_bytes += len(frame.content)
    if batch:
        yield batch


class Sets(_SetCalls, Caller):
    """The data sets of a service. ``Client.sets``."""


class AsyncSets(_SetCalls, AsyncCaller):
    """The data sets of a service. ``AsyncClient.sets``."""
