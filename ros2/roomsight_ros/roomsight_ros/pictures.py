"""Pictures of messages as files, as every recognizer takes them."""

from __future__ import annotations

from typing import Any

import numpy

#: Channels of 8 bits: how many, and which are red, green and blue, or gray alone.
_CHANNELS = {
    "mono8": (1, [0]),
    "8UC1": (1, [0]),
    "rgb8": (3, [0, 1, 2]),
    "bgr8": (3, [2, 1, 0]),
    "8UC3": (3, [2, 1, 0]),
    "rgba8": (4, [0, 1, 2]),
    "bgra8": (4, [2, 1, 0]),
    "8UC4": (4, [2, 1, 0]),
}


def encoded(message: Any) -> bytes:
    """The picture of a ``sensor_msgs/CompressedImage``, or of a ``sensor_msgs/Image`` as PGM or PPM.

    Raises ``ValueError`` where it is of an encoding that is not read, or has fewer pixels than it says.
    """
    if hasattr(message, "format"):
        return bytes(message.data)
    if message.encoding not in _CHANNELS:
        known = ", ".join(_CHANNELS)
        raise ValueError(f"pictures of the encoding {message.encoding} are not read, {known} are: set transport to compressed")
    n_channels, order = _CHANNELS[message.encoding]
    height, width, step = message.height, message.width, message.step or message.width * n_channels
    data = numpy.frombuffer(message.data, numpy.uint8)
    if not (height and width and step >= width * n_channels and data.size >= height * step):
        raise ValueError(f"a picture of {width} x {height} pixels, {step} bytes a row, has {data.size} bytes")
    rows = data[: height * step].reshape(height, step)[:, : width * n_channels]
    pixels = rows.reshape(height, width, n_channels)[:, :, order]
    return b"P%d\n%d %d\n255\n" % (5 if len(order) == 1 else 6, width, height) + pixels.tobytes()
