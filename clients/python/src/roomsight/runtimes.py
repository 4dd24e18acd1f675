"""Where ONNX Runtime is, which models with networks look through."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import Optional


def onnx_runtime() -> Optional[str]:
    """The library that ``ROOMSIGHT_ONNX_RUNTIME`` names, else that of the package ``onnxruntime``, where it is installed; it is not loaded."""
    named = os.environ.get("ROOMSIGHT_ONNX_RUNTIME")
    if named:
        return named
    package = importlib.util.find_spec("onnxruntime")
    if package is None or package.origin is None:
        return None
    libraries = sorted((Path(package.origin).parent / "capi").glob("libonnxruntime.*"))
    return str(libraries[0]) if libraries else None
