"""What a robot senses beside pictures."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass
from typing import Any, Optional, Sequence

_HEAD = struct.Struct("<Ifff")


@dataclass(frozen=True)
class Scan:
    """One sweep of a laser scanner, with the fields of a ``sensor_msgs/LaserScan`` that are needed.

    Angles are in radians counterclockwise from ahead, ranges in meters; one that met nothing is ``inf``, ``nan``, or beyond ``range_max``.
    """

    angle_min: float
    angle_increment: float
    range_max: float
    ranges: Sequence[float]

    def as_json(self) -> str:
        """As a form or an object of JSON has it."""
        ranges = [float(distance) if math.isfinite(distance) else None for distance in self.ranges]
        return json.dumps(
            {
                "angle_min": float(self.angle_min),
                "angle_increment": float(self.angle_increment),
                "range_max": float(self.range_max),
                "ranges": ranges,
            }
        )

    def as_bytes(self) -> bytes:
        """As it lies before the image in a stream."""
        head = _HEAD.pack(len(self.ranges), self.angle_min, self.angle_increment, self.range_max)
        return head + struct.pack(f"<{len(self.ranges)}f", *self.ranges)


@dataclass(frozen=True)
class Odometry:
    """Where a robot is by its wheels: meters, and the heading in radians, in coordinates that may begin anywhere and drift."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class Beside:
    """What is told of a frame beside the image: when it was captured, as of ``time.time_ns()``, and what was sensed then."""

    captured_at_ns: Optional[int] = None
    odometry: Optional[Odometry] = None
    scan: Optional[Scan] = None

    @property
    def is_nothing(self) -> bool:
        """Whether there is nothing to tell."""
        return self.captured_at_ns is None and self.odometry is None and self.scan is None


def core_scan(scan: Optional[Scan]) -> Any:
    """As the part in Rust takes it."""
    return None if scan is None else (scan.angle_min, scan.angle_increment, scan.range_max, list(scan.ranges))
