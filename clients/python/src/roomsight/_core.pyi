"""The part in Rust (crates/python). `roomsight.core` gives its answers their types."""

import os
from typing import Any, Optional, Union

from .calls import Frame

class ModelError(Exception):
    """A folder holds no model that can be loaded; the message says why."""

class FrameError(Exception):
    """A frame is no picture, or one beyond the limits; the message says why."""

class Filter: ...

class Recognizer:
    def __init__(self, folder: str, onnx_runtime: Union[str, os.PathLike[str], None] = None) -> None: ...
    @property
    def rooms(self) -> list[str]: ...
    @property
    def digest(self) -> str: ...
    def filter(self, trust: Optional[float] = None) -> Filter: ...
    def recognize(
        self,
        frame: Frame,
        top: Optional[int] = None,
        explain: bool = False,
        filter: Optional[Filter] = None,
        elapsed: float = 0.0,
        odometry: Optional[tuple[float, float, float]] = None,
        scan: Optional[tuple[float, float, float, list[float]]] = None,
    ) -> dict[str, Any]: ...
