"""What the robot senses beside pictures: scans and odometry, found by the time of a picture."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from threading import Lock
from typing import Any, Generic, Optional, TypeVar

from roomsight import Odometry, Scan

T = TypeVar("T")

#: How far what belongs together may be apart.
MAX_APART_NS = 250_000_000

#: How many are kept: more than come while a picture is looked at.
N_KEPT = 64


@dataclass(frozen=True)
class Senses:
    """What was sensed when a picture was taken."""

    scan: Optional[Scan] = None
    odometry: Optional[Odometry] = None


class Recent(Generic[T]):
    """The last messages of a topic, by their stamps."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, T]] = deque(maxlen=N_KEPT)
        self._lock = Lock()

    def add(self, stamp_ns: int, what: T) -> None:
        """Keeps one more."""
        with self._lock:
            self._kept.append((stamp_ns, what))

    def at(self, stamp_ns: int) -> Optional[T]:
        """The one nearest to a time, if it is near."""
        with self._lock:
            nearest = min(self._kept, key=lambda kept: abs(kept[0] - stamp_ns), default=None)
        return nearest[1] if nearest and abs(nearest[0] - stamp_ns) <= MAX_APART_NS else None


def stamp_ns(message: Any) -> int:
    """When a message says it is of."""
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def scan_of(message: Any) -> Scan:
    """A ``sensor_msgs/LaserScan``."""
    return Scan(message.angle_min, message.angle_increment, message.range_max, message.ranges)


def odometry_of(message: Any) -> Odometry:
    """A ``nav_msgs/Odometry``, on the floor."""
    pose = message.pose.pose
    x, y, z, w = pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return Odometry(pose.position.x, pose.position.y, heading)
