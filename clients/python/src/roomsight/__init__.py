"""Client of roomsight, which tells a robot which room it is in.

    from roomsight import Client

    with Client("http://127.0.0.1:8080") as client:
        print(client.recognize("frame.jpg").room)

    with Client("http://127.0.0.1:8080") as client, client.stream(robot="wall-e") as stream:
        for frame in frames:
            stream.send(frame)
            print(stream.receive())

``AsyncClient`` has the same calls for ``asyncio``. Without a service, where the whole distribution is installed:

    from roomsight import Recognizer

    print(Recognizer("models/home/1").recognize("frame.jpg").room)
"""

from typing import TYPE_CHECKING, Any

from .aio import AsyncClient, AsyncEvents, AsyncStream
from .client import Client, Events, Stream
from .errors import ConnectionLost, Problem, ProtocolError, Refused, ResumePoint, RoomsightError
from .events import (
    AnswerEvent,
    Event,
    InboxChanged,
    Lost,
    OtherEvent,
    RobotFound,
    RobotJoined,
    RobotLeft,
    RobotLost,
    RoomChanged,
    ServingChanged,
    SetChanged,
    SwapFailed,
    TrainingChanged,
)
from .inbox import (
    AsyncInbox,
    Inbox,
    InboxFrame,
    InboxLabel,
    InboxList,
    InboxRule,
    InboxState,
    LabelConflict,
    LabeledFrames,
    LearningPolicy,
)
from .keys import AsyncKeys, KeyInfo, Keys, NewKey
from .lasting import AsyncLastingStream, LastingStream
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
from .senses import Odometry, Scan
from .service import AuditEntry, AuditList, HistoryPoint, ServiceHistory, ServiceInfo
from .sets import (
    AddedFrames,
    AsyncSets,
    CopiedFrame,
    DataSet,
    FrameList,
    LeftOutFile,
    RefusedFrame,
    SetChange,
    SetCheck,
    SetDrive,
    SetFinding,
    SetFrame,
    SetRoom,
    Sets,
    SetSummary,
)
from .trainings import (
    AsyncTrainings,
    ModelComparison,
    PublishedVersion,
    RightOf,
    Training,
    Trainings,
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

if TYPE_CHECKING:
    from .core import Follower as Follower
    from .core import FrameError as FrameError
    from .core import ModelError as ModelError
    from .core import Recognition as Recognition
    from .core import Recognizer as Recognizer

# Loaded when one is first named, and not among `__all__`: a client alone does not have them.
_OF_THE_CORE = {"Follower", "FrameError", "ModelError", "Recognition", "Recognizer"}


def __getattr__(name: str) -> Any:
    if name in _OF_THE_CORE:
        from . import core

        return getattr(core, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "AddedFrames",
    "Answer",
    "AnswerEvent",
    "AsyncClient",
    "AsyncEvents",
    "AsyncInbox",
    "AsyncKeys",
    "AsyncLastingStream",
    "AsyncSets",
    "AsyncStream",
    "AsyncTrainings",
    "AuditEntry",
    "AuditList",
    "Client",
    "Configured",
    "ConnectionLost",
    "CopiedFrame",
    "DataSet",
    "Draining",
    "Dropped",
    "Error",
    "Event",
    "Events",
    "Failure",
    "Filtered",
    "FrameCounts",
    "FrameList",
    "FramePose",
    "Hello",
    "HistoryPoint",
    "Inbox",
    "InboxChanged",
    "InboxFrame",
    "InboxLabel",
    "InboxList",
    "InboxRule",
    "InboxState",
    "KeyInfo",
    "KeypointEvidence",
    "Keys",
    "LabelConflict",
    "LabeledFrames",
    "LastingStream",
    "LearningPolicy",
    "LeftOutFile",
    "Lost",
    "Message",
    "Model",
    "ModelChanged",
    "ModelComparison",
    "ModelList",
    "ModelName",
    "NearestFrame",
    "Network",
    "NewKey",
    "Notice",
    "OtherEvent",
    "PastAnswer",
    "Problem",
    "ProtocolError",
    "PublishedVersion",
    "Refused",
    "RefusedFrame",
    "Result",
    "ResumePoint",
    "RightOf",
    "Robot",
    "RobotFound",
    "RobotJoined",
    "RobotLeft",
    "RobotLost",
    "RoomChanged",
    "RoomProbability",
    "RoomsightError",
    "ServiceHistory",
    "ServiceInfo",
    "ServingChanged",
    "SetChange",
    "SetChanged",
    "SetCheck",
    "SetDrive",
    "SetFinding",
    "SetFrame",
    "SetRoom",
    "SetSummary",
    "Sets",
    "Shadow",
    "StateChange",
    "Stream",
    "StreamLimits",
    "StreamSettings",
    "SwapFailed",
    "Timings",
    "Training",
    "TrainingChanged",
    "Trainings",
    "Version",
]
