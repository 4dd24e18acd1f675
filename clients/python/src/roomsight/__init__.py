"""Client of roomsight, which tells a robot which room it is in.

    from roomsight import Client

    with Client("http://127.0.0.1:8080") as client:
        print(client.recognize("frame.jpg").room)

    with Client("http://127.0.0.1:8080") as client, client.stream(robot="wall-e") as stream:
        for frame in frames:
            stream.send(frame)
            print(stream.receive())

``AsyncClient`` has the same calls for ``asyncio``.
"""

from .aio import AsyncClient, AsyncStream
from .client import Client, Stream
from .errors import ConnectionLost, ProtocolError, Refused, RoomsightError
from .messages import (
    Configured,
    Draining,
    Dropped,
    Error,
    Hello,
    Message,
    ModelChanged,
    Notice,
    Result,
    ResumePoint,
    StreamLimits,
    StreamSettings,
)
from .types import (
    Answer,
    Filtered,
    Model,
    ModelList,
    ModelName,
    Network,
    Problem,
    RoomProbability,
    Timings,
    Version,
)

__all__ = [
    "Answer",
    "AsyncClient",
    "AsyncStream",
    "Client",
    "Configured",
    "ConnectionLost",
    "Draining",
    "Dropped",
    "Error",
    "Filtered",
    "Hello",
    "Message",
    "Model",
    "ModelChanged",
    "ModelList",
    "ModelName",
    "Network",
    "Notice",
    "Problem",
    "ProtocolError",
    "Refused",
    "Result",
    "ResumePoint",
    "RoomProbability",
    "RoomsightError",
    "Stream",
    "StreamLimits",
    "StreamSettings",
    "Timings",
    "Version",
]
