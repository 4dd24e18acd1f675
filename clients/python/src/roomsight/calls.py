"""What both clients share: how calls are made up and their answers read, apart from any socket."""

from __future__ import annotations

import json
import os
import ssl
from pathlib import Path
from typing import Any, Optional, Protocol, TypeVar, Union
from urllib.parse import quote

import httpx
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus

from .errors import ConnectionLost, Problem, ProtocolError, Refused, ResumePoint, RoomsightError
from .messages import Hello, read_message
from .senses import Scan
from .types import decode

T = TypeVar("T")


class Picture(Protocol):
    """Pixels in memory, such as a NumPy array or a Pillow image."""

    @property
    def __array_interface__(self) -> dict[str, Any]: ...

    def tobytes(self) -> bytes: ...


#: An encoded image (JPEG, PNG, ...), the path of one, or 8-bit pixels: height x width (gray) or height x width x 3
#: (RGB; OpenCV's are BGR: ``frame[:, :, ::-1]``).
Frame = Union[bytes, "os.PathLike[str]", str, Picture]

#: A model's folder as a tar, tar.gz or zip file: its bytes, or the path of one.
Archive = Union[bytes, "os.PathLike[str]", str]

DEFAULT_URL = "http://127.0.0.1:8080"
#: How long to wait for a connection or the answer to a call, in seconds.
PATIENCE_S = 30.0
#: How long an upload may take, in seconds.
UPLOAD_PATIENCE_S = 600.0
_BINARY = {"Content-Type": "application/octet-stream"}


def events_call(fleet: bool) -> dict[str, Any]:
    """The request for events, as arguments for httpx. They may be far between; a connection that is gone is found by the system."""
    return {"method": "GET", "url": "/v1/events", "params": scope(fleet), "timeout": httpx.Timeout(PATIENCE_S, read=None)}


def scope(fleet: bool) -> dict[str, str]:
    """Whose robots and events are asked for."""
    return {"scope": "fleet"} if fleet else {}


def check_url(url: str) -> str:
    """The address without its last slash. Raises ``ValueError`` where it is none."""
    if not url.startswith(("http://", "https://")):
        raise ValueError(f"{url!r} is no address of a service; give one such as {DEFAULT_URL}")
    return url.rstrip("/")


def authorization(key: Optional[str]) -> dict[str, str]:
    """The header that carries the key."""
    return {} if key is None else {"Authorization": f"Bearer {key}"}


def tls(url: str, context: Optional[ssl.SSLContext]) -> Optional[ssl.SSLContext]:
    """Whom to believe at this address; None where it is no ``https://``."""
    if not url.startswith("https://"):
        return None
    return context or ssl.create_default_context()


def frame_bytes(frame: Frame) -> bytes:
    """The encoded image. Raises ``TypeError`` where pixels are none that can be sent."""
    if isinstance(frame, bytes):
        return frame
    if isinstance(frame, (str, os.PathLike)):
        return Path(frame).read_bytes()
    if hasattr(frame, "__array_interface__"):
        return _encoded(frame)
    raise TypeError(f"a frame is bytes, a path, a NumPy array or a Pillow image, not {type(frame).__name__}")


def _encoded(picture: Picture) -> bytes:
    """As a portable graymap or pixmap: nothing is lost, and nothing has to be compressed."""
    mode = getattr(picture, "mode", None)
    if mode not in (None, "L", "RGB"):
        raise TypeError(f"a Pillow image is of mode L or RGB, not {mode}: give image.convert(\"RGB\")")
    shape, kind = picture.__array_interface__["shape"], picture.__array_interface__["typestr"]
    is_gray = len(shape) == 2
    if kind != "|u1" or not (is_gray or (len(shape) == 3 and shape[2] == 3)):
        sides = " x ".join(str(side) for side in shape)
        raise TypeError(f"pixels are 8-bit, height x width or height x width x 3, not {sides} of {kind}")
    return b"%s %d %d 255\n" % (b"P5" if is_gray else b"P6", shape[1], shape[0]) + picture.tobytes()


def given(values: dict[str, Any]) -> dict[str, Any]:
    """Those that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def frame_body(frame: Frame, scan: Optional[Scan] = None) -> dict[str, Any]:
    """One frame as the body of a call, with the scan beside it where there is one, as arguments for httpx."""
    if scan is None:
        return {"content": frame_bytes(frame), "headers": _BINARY}
    return {"files": {"frame": ("frame", frame_bytes(frame)), "scan": (None, scan.as_json(), "application/json")}}


def path(*parts: Union[str, int]) -> str:
    """A path of the service, such as that of a data set."""
    return "/".join(["/v1", *(_quoted(str(part)) for part in parts)])


def _quoted(part: str) -> str:
    """A name as a part of a path. One of dots alone would else be a step along the path."""
    return quote(part, safe="") if part.strip(".") else part.replace(".", "%2E")


def if_match(epoch: Optional[int]) -> dict[str, str]:
    """The header with which nothing is done where what serves was changed since the epoch."""
    return {} if epoch is None else {"If-Match": f'"{epoch}"'}


def archive_body(archive: Archive) -> dict[str, Any]:
    """An archive as the body of a call, as arguments for httpx."""
    content = archive if isinstance(archive, bytes) else Path(archive).read_bytes()
    return {"content": content, "headers": _BINARY}


def check_done(response: httpx.Response) -> None:
    """Raises ``Refused`` or ``ProtocolError`` where a call without an answer failed."""
    if not response.is_success:
        raise refused(response.status_code, response.content, response.headers.get("Retry-After"))


def read_answer(kind: type[T], response: httpx.Response) -> T:
    """The answer to a call. Raises ``Refused`` or ``ProtocolError``."""
    if response.is_success:
        return decode(kind, _json(response.content, response.status_code))
    raise refused(response.status_code, response.content, response.headers.get("Retry-After"))


def refused(status: int, body: bytes, retry_after: Optional[str]) -> RoomsightError:
    """The error in an answer that is no success."""
    try:
        problem = decode(Problem, _json(body, status))
    except ProtocolError as error:
        return error
    return Refused(problem, float(retry_after) if retry_after and retry_after.isdecimal() else None)


def lost(error: Exception, point: Optional[ResumePoint] = None) -> RoomsightError:
    """The error for one of httpx, websockets or the operating system."""
    if isinstance(error, InvalidStatus):
        response = error.response
        return refused(response.status_code, bytes(response.body or b""), response.headers.get("Retry-After"))
    if isinstance(error, ConnectionClosed) and error.rcvd is not None:
        return ConnectionLost(error.rcvd.reason, error.rcvd.code, point)
    if isinstance(error, InvalidHandshake):
        return ProtocolError(f"the stream was not opened: {error}")
    return ConnectionLost(str(error) or type(error).__name__, point=point)


def read_hello(text: Union[str, bytes]) -> Hello:
    """The first message of a stream."""
    message = read_message(text)
    if not isinstance(message, Hello):
        raise ProtocolError(f"the stream begins with {type(message).__name__}, not with Hello")
    return message


def _json(body: bytes, status: int) -> Any:
    try:
        return json.loads(body)
    except ValueError as error:
        raise ProtocolError(f"the address answers {status}, but not as roomsight does") from error
