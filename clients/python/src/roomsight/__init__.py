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

from .aio import AsyncClient, AsyncEvents, AsyncStream
from .client import Client, Events, Stream
from .errors import ConnectionLost, Problem, ProtocolError, Refused, ResumePoint, RoomsightError
from .events import (
    AnswerEvent,
    Event,
    Lost,
    OtherEvent,
    RobotFound,
    RobotJoined,
    RobotLeft,
    RobotLost,
    RoomChanged,
    ServingChanged,
    SwapFailed,
)
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
    StreamLimits,
    StreamSettings,
)
from .types import (
    Answer,
    Failure,
    Filtered,
    FrameCounts,
    FramePose,
    KeypointEvidence,
    Model,
    ModelList,
    ModelName,
    NearestFrame,
    Network,
    PastAnswer,
    Robot,
    RoomProbability,
    Shadow,
    StateChange,
    Timings,
    Version,
)

__all__ = [
    "Answer",
    "AnswerEvent",
    "AsyncClient",
    "AsyncEvents",
    "AsyncStream",
    "Client",
    "Configured",
    "ConnectionLost",
    "Draining",
    "Dropped",
    "Error",
    "Event",
    "Events",
    "Failure",
    "Filtered",
    "FrameCounts",
    "FramePose",
    "Hello",
    "KeypointEvidence",
    "Lost",
    "Message",
    "Model",
    "ModelChanged",
    "ModelList",
    "ModelName",
    "NearestFrame",
    "Network",
    "Notice",
    "OtherEvent",
    "PastAnswer",
    "Problem",
    "ProtocolError",
    "Refused",
    "Result",
    "ResumePoint",
    "Robot",
    "RobotFound",
    "RobotJoined",
    "RobotLeft",
    "RobotLost",
    "RoomChanged",
    "RoomProbability",
    "RoomsightError",
    "ServingChanged",
    "Shadow",
    "StateChange",
    "Stream",
    "StreamLimits",
    "StreamSettings",
    "SwapFailed",
    "Timings",
    "Version",
]
