"""Recognizes frames within this process, without a service.

    from roomsight import Recognizer

    recognizer = Recognizer("models/home/1")
    print(recognizer.recognize(cv2.imread("frame.jpg")[:, :, ::-1]).room)

Takes the whole distribution: `make wheel` builds it, and a client that was installed alone raises ``ImportError`` here.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from typing import Optional, Union

from . import runtimes
from .calls import Frame
from .senses import Odometry, Scan, core_scan
from .types import Filtered, FramePose, NearestFrame, RoomProbability, decode

try:
    from . import _core
    from ._core import FrameError, ModelError
except ImportError as error:
    raise ImportError(f"this roomsight is a client alone ({error}): `make wheel` builds the one that recognizes by itself") from error

__all__ = ["Follower", "FrameError", "ModelError", "Recognition", "Recognizer"]


@dataclass(frozen=True)
class Recognition:
    """Which room a frame shows. Do not act on the room where ``known`` is false.

    The fields are those of ``Answer``, which a service gives. ``filtered`` is what the frames up to this one say together, of
    a ``Follower``.
    """

    room: str
    known: bool
    probability: float
    probabilities: list[RoomProbability]
    keypoints: int
    damaged_rows: int = 0
    unknown: Optional[str] = None
    novelty: Optional[float] = None
    nearest: Optional[list[NearestFrame]] = None
    pose: Optional[FramePose] = None
    filtered: Optional[Filtered] = None


class Recognizer:
    """A model. Several threads may recognize with it at the same time: Python's lock is free meanwhile."""

    def __init__(self, folder: Union[str, os.PathLike[str]], *, onnx_runtime: Union[str, os.PathLike[str], None] = None) -> None:
        """Loads the model in a folder, as ``roomsight train`` writes it.

        ``onnx_runtime`` is the library of ONNX Runtime, for models that look through networks; the package ``onnxruntime`` has
        one, which is taken by default where it is installed. Raises ``ModelError`` where the folder holds no model that can be loaded.
        """
        self._core = _core.Recognizer(os.fspath(folder), onnx_runtime or runtimes.onnx_runtime())

    @property
    def rooms(self) -> list[str]:
        """The rooms that it tells apart."""
        return self._core.rooms

    @property
    def digest(self) -> str:
        """The BLAKE3 digest of the model's file, in hexadecimal digits."""
        return self._core.digest

    def recognize(
        self, frame: Frame, *, scan: Optional[Scan] = None, top: Optional[int] = None, explain: bool = False
    ) -> Recognition:
        """What a frame shows: the bytes or the path of an encoded image, a NumPy array or a Pillow image of 8-bit pixels, gray or RGB.

        ``scan`` is what the robot's laser measured beside it, for models that look at that. ``top`` leaves only the most probable
        rooms; ``explain`` also tells the training frames that are most like it and, of models that were trained on poses, where it was
        taken. Raises ``FrameError`` where it is no picture or one beyond the limits (16 MiB, 50 megapixels), or the scan is none or
        of another field than trained, ``TypeError`` where it is nothing of the above.
        """
        return decode(Recognition, self._core.recognize(frame, top, explain, scan=core_scan(scan)))

    def follow(self, *, trust: Optional[float] = None) -> Follower:
        """Follows one robot: each of its frames with what those before it say, as a stream of the service does."""
        return Follower(self._core, self._core.filter(trust))


class Follower:
    """The frames of one robot, one after the other."""

    def __init__(self, core: _core.Recognizer, belief: _core.Filter) -> None:
        self._core, self._belief = core, belief
        self._before: Optional[float] = None

    def recognize(
        self,
        frame: Frame,
        *,
        at: Optional[float] = None,
        odometry: Optional[Odometry] = None,
        scan: Optional[Scan] = None,
        top: Optional[int] = None,
        explain: bool = False,
    ) -> Recognition:
        """What a frame shows, and in ``filtered`` what it says together with those before it.

        ``at`` is when it was taken, in seconds of any clock that runs on; by default now. With ``odometry`` the way counts instead of the
        time: a robot that stands is believed to stay. Raises as ``Recognizer.recognize``.
        """
        at = time.monotonic() if at is None else at
        elapsed = 0.0 if self._before is None else max(0.0, at - self._before)
        place = None if odometry is None else (odometry.x, odometry.y, odometry.heading)
        seen = self._core.recognize(frame, top, explain, self._belief, elapsed, place, core_scan(scan))
        self._before = at
        return decode(Recognition, seen)
