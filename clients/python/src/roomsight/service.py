"""What a service tells of itself: its set-up, its last hour, and what people changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import httpx

from . import calls
from .steps import Method, Request, Steps, ask
from .types import Timings


@dataclass(frozen=True)
class ServiceInfo:
    """A service and how it is set up. ``data``: rooms can be taught there; ``keys``: callers need some; ``frames_kept``:
    the robots' last frames are. A robot is lost after ``lost_after_s`` seconds of unknown answers."""

    version: str
    started_at: str
    uptime_s: float
    data: bool
    keys: bool
    threads: int
    frames_kept: bool
    lost_after_s: float
    models_folder: str
    webhooks: int
    mqtt: bool


@dataclass(frozen=True)
class HistoryPoint:
    """What was so in the interval that ended ``at``: ``answers`` to ``dropped`` count frames, ``unknown`` the answers that were
    not known. ``queue`` is the most that waited, ``busy`` how many threads recognized on the average, ``latency_ms`` where
    the time of a frame went. ``memory_bytes`` and ``cpu_s`` are None where the system does not tell."""

    at: str
    answers: int
    errors: int
    refused: int
    dropped: int
    unknown: int
    queue: int
    busy: float
    latency_ms: Timings
    streams: int
    robots: int
    lost: int
    memory_bytes: Optional[int] = None
    cpu_s: Optional[float] = None
    p50_ms: Optional[float] = None
    p99_ms: Optional[float] = None


@dataclass(frozen=True)
class ServiceHistory:
    """The last hour of a service, a point for every ``interval_s`` seconds, the oldest first."""

    interval_s: int
    points: list[HistoryPoint]


@dataclass(frozen=True)
class AuditEntry:
    """Something that was changed: ``what`` was done to a ``target``, a model, a data set or a key. ``who`` is the name of a key,
    an address, or ``policy``."""

    id: int
    at: str
    who: str
    what: str
    target: str
    detail: str


@dataclass(frozen=True)
class AuditList:
    """What was changed, the newest first; ``next`` is where the older ones begin, None where there are none."""

    entries: list[AuditEntry]
    next: Optional[int] = None


class ServiceCalls:
    """The calls about the service itself."""

    @Method
    def service(self) -> Steps[ServiceInfo]:
        """The service and how it is set up."""
        return ask(ServiceInfo, "GET", "/v1/service")

    @Method
    def service_history(self) -> Steps[ServiceHistory]:
        """The last hour of the service."""
        return ask(ServiceHistory, "GET", "/v1/service/history")

    @Method
    def audit(self, *, before: Optional[int] = None, limit: Optional[int] = None) -> Steps[AuditList]:
        """Who changed what, ``before`` an entry."""
        return ask(AuditList, "GET", "/v1/audit", params=calls.given({"before": before, "limit": limit}))

    @Method
    def is_ready(self) -> Steps[bool]:
        """Whether the service answers frames."""
        response: httpx.Response = yield Request("GET", "/readyz")
        return response.is_success
