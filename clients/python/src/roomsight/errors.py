"""What can go wrong."""

from __future__ import annotations

import typing
from typing import Optional

if typing.TYPE_CHECKING:
    from .messages import ResumePoint
    from .types import Problem


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
