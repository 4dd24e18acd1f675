"""The calls about robots."""

from __future__ import annotations

from typing import Optional

from . import calls
from .steps import Method, Steps, ask, fetch
from .types import Robot, RobotList


class RobotCalls:
    """The calls about robots."""

    @Method
    def robots(self, *, fleet: bool = False) -> Steps[list[Robot]]:
        """The robots that stream or send requests, and for an hour those that left; with ``fleet`` also those of other services, which
        ``service`` names."""
        return (yield from ask(RobotList, "GET", "/v1/robots", params=calls.scope(fleet))).robots

    @Method
    def robot(self, stream: str) -> Steps[Robot]:
        """One robot, by its name or its stream's."""
        return ask(Robot, "GET", calls.path("robots", stream))

    @Method
    def robot_frame(self, stream: str, *, width: Optional[int] = None) -> Steps[bytes]:
        """The last frame of a robot: a JPEG at most so wide, or the picture as the robot sent it."""
        return fetch(calls.path("robots", stream, "frame"), params=calls.given({"width": width}))
