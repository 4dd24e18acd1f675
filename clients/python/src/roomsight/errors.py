"""What can go wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional


@dataclass(frozen=True)
class Problem:
    """An error as the service tells it (RFC 9457): ``detail`` says what to do about it."""

    type: str
    title: str
    status: int
    detail: str
    request_id: str


@dataclass(frozen=True)
class ResumePoint:
    """Where a stream can go on after its connection broke.

    ``last_seq`` is the last frame answered, ``sent_seq`` the last one sent. ``resume`` is how the stream stood, sealed: with it
    another service goes on with the stream, where services share their ``resume_keys``. ``session`` and ``resume`` are secrets.
    """

    session: str
    last_seq: Optional[int] = None
    sent_seq: Optional[int] = None
    resume: Optional[str] = None


class RoomsightError(Exception):
    """Anything that goes wrong with a service."""


class Refused(RoomsightError):
    """The service refused a call or a stream, and says why.

    ``retry_after`` is the number of seconds after which to try again, where the service knows.
    """

    def __init__(self, problem: Problem, retry_after: Optional[float] = None) -> None:
        super().__init__(f"{problem.title}: {problem.detail}")
        self.problem = problem
        self.retry_after = retry_after


class ConnectionLost(RoomsightError):
    """The service cannot be reached, or the connection ended.

    ``code`` is the code with which the service closed a stream: 1001 it stops, 1008 the key's rights, 1009 a
    message too long, 1013 try again later. ``point`` is where ``Client.resume`` can go on.
    """

    def __init__(
        self, reason: str, code: Optional[int] = None, point: Optional[ResumePoint] = None
    ) -> None:
        super().__init__(reason if code is None else f"closed with {code} {reason}".rstrip())
        self.code = code
        self.point = point


class ProtocolError(RoomsightError):
    """An answer that roomsight does not give: something else is at the address, or between."""
