"""Trainings that the service runs: what it tells of them, and the calls."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Optional

from . import calls
from .steps import AsyncCaller, Caller, Method, Pause, Steps, ask

#: How often to ask whether a training has ended.
_EVERY_S = 0.5


@dataclass(frozen=True)
class RightOf:
    """``n_right`` of ``n_frames`` are right."""

    n_right: int
    n_frames: int


@dataclass(frozen=True)
class ModelComparison:
    """How a model does (``now``) beside the version that served when it was trained (``before``); ``is_worse`` by more than
    chance. ``compared_on`` is ``same_frames``, or ``own_held_out`` where each was tried on its own."""

    serving: str
    compared_on: str
    before: RightOf
    now: RightOf
    is_worse: bool


@dataclass(frozen=True)
class PublishedVersion:
    """A version of a model."""

    name: str
    version: int


@dataclass(frozen=True)
class Training:
    """A training. ``state`` is ``running``, ``done``, ``failed`` or ``cancelled``; ``error`` says why it failed.

    ``step`` is what it does just now, ``progress`` how much of that is done, ``rate`` the share of held-out frames that were
    answered right. ``log`` is what it said and ``report`` what ``roomsight train --json`` prints, where one training is asked for.
    """

    id: int
    set: str
    model: str
    effort: str
    state: str
    began_at: str
    by: str
    step: Optional[str] = None
    progress: Optional[float] = None
    ended_at: Optional[str] = None
    error: Optional[str] = None
    rate: Optional[float] = None
    n_frames: Optional[int] = None
    comparison: Optional[ModelComparison] = None
    published: Optional[PublishedVersion] = None
    log: Optional[list[str]] = None
    report: Optional[dict[str, Any]] = None


@dataclass(frozen=True)
class TrainingList:
    """The trainings there were, the newest first."""

    trainings: list[Training]


#: A class with a method `list` cannot say so.
_Trainings = list[Training]


class _TrainingCalls:
    """The calls about trainings."""

    @Method
    def begin(
        self, set: str, *, model: str, effort: Optional[str] = None, camera: Optional[str] = None
    ) -> Steps[Training]:
        """Begins to train a version of ``model`` on a data set. It is ``Refused`` while another training runs.

        ``effort`` is ``fast``, ``default`` or ``best``; ``camera`` ``perspective``, ``equirectangular`` or ``omnidirectional``.
        """
        body = {"set": set, "model": model, "effort": effort, "camera": camera}
        return ask(Training, "POST", "/v1/trainings", json=calls.given(body))

    @Method
    def list(self) -> Steps[_Trainings]:
        """The trainings there were, the newest first."""
        return (yield from ask(TrainingList, "GET", "/v1/trainings")).trainings

    @Method
    def show(self, id: int) -> Steps[Training]:
        """One training, with its log and its report."""
        return _show(id)

    @Method
    def wait(self, id: int, timeout: Optional[float] = None) -> Steps[Training]:
        """The training when it has ended, whether well or not. Raises ``TimeoutError`` after ``timeout`` seconds; it runs on
        then."""
        began = time.monotonic()
        while True:
            training = yield from _show(id)
            if training.state != "running":
                return training
            left_s = _EVERY_S if timeout is None else timeout - (time.monotonic() - began)
            if left_s <= 0.0:
                raise TimeoutError(f"training {id} still runs after {timeout} seconds")
            yield Pause(min(_EVERY_S, left_s))

    @Method
    def cancel(self, id: int) -> Steps[Training]:
        """Ends a training. There is no model then."""
        return ask(Training, "POST", calls.path("trainings", id, "cancel"))

    @Method
    def publish(self, id: int, *, even_if_worse: bool = False) -> Steps[PublishedVersion]:
        """Makes what was trained the next version of its model; it serves nobody until it is activated or gets a label.

        It is ``Refused`` where it is worse than the version that served, unless ``even_if_worse``.
        """
        url, body = calls.path("trainings", id, "publish"), {"even_if_worse": even_if_worse}
        return ask(PublishedVersion, "POST", url, json=body, timeout=calls.UPLOAD_PATIENCE_S)


def _show(id: int) -> Steps[Training]:
    return ask(Training, "GET", calls.path("trainings", id))


class Trainings(_TrainingCalls, Caller):
    """The trainings of a service. ``Client.trainings``."""


class AsyncTrainings(_TrainingCalls, AsyncCaller):
    """The trainings of a service. ``AsyncClient.trainings``."""
