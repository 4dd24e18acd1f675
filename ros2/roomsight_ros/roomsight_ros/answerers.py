"""What answers pictures: a model in this process, or a service."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Protocol, Union

from roomsight import Client, Dropped, Error, Filtered, Result

from .senses import Senses


class SingleAnswer(Protocol):
    """What a picture says by itself: of a service, or of a model in this process."""

    room: str
    known: bool
    probability: float
    unknown: Optional[str]
    novelty: Optional[float]


@dataclass(frozen=True)
class Told:
    """What a picture says by itself, and together with those before it."""

    single: SingleAnswer
    filtered: Filtered
    model: str


class ModelAnswerer:
    """A model in this process."""

    def __init__(self, folder: str, trust: Optional[float]) -> None:
        from roomsight.core import Recognizer

        self._follower = Recognizer(folder).follow(trust=trust)
        self._folder = folder

    def answer(self, picture: bytes, stamp_ns: int, senses: Senses) -> Optional[Told]:
        """What a picture says that was taken at a time, with what was sensed then. Raises where it is no picture."""
        seen = self._follower.recognize(picture, at=stamp_ns / 1e9, odometry=senses.odometry, scan=senses.scan)
        assert seen.filtered is not None, "a follower filters"
        return Told(seen, seen.filtered, self._folder)

    def close(self) -> None:
        """Nothing is held."""


class ServiceAnswerer:
    """A service, by a stream that goes on where its connection breaks."""

    def __init__(self, url: str, key: Optional[str], robot: str, trust: Optional[float]) -> None:
        self._client = Client(url, key)
        self._stream = self._client.lasting_stream(robot=robot, filter=True if trust is None else {"trust": trust})

    def answer(self, picture: bytes, stamp_ns: int, senses: Senses) -> Optional[Told]:
        """What a picture says that was taken at a time, with what was sensed then; ``None`` where the service was too busy for it. Raises
        where it is no picture."""
        seq = self._stream.send(picture, captured_at_ns=stamp_ns or None, odometry=senses.odometry, scan=senses.scan)
        while True:
            ending = self._stream.answer()
            if ending.seq == seq:
                return self._told(ending)

    def _told(self, ending: Union[Result, Dropped, Error]) -> Optional[Told]:
        if isinstance(ending, Error):
            raise ValueError(ending.problem.detail or ending.problem.title)
        if isinstance(ending, Dropped):
            return None
        answer = ending.answer
        filtered = ending.filtered or Filtered(answer.room, answer.probability, answer.probabilities, answer.known)
        return Told(answer, filtered, f"{answer.model.name}/{answer.model.version}")

    def close(self) -> None:
        self._stream.close()
        self._client.close()
