"""The protocol apart from any socket."""

import json
import struct
import unittest

from roomsight import (
    Dropped,
    Error,
    InboxChanged,
    OtherEvent,
    ProtocolError,
    Result,
    ResumePoint,
    RoomChanged,
    SetChanged,
    TrainingChanged,
)
from roomsight.senses import Beside, Odometry, Scan
from roomsight.messages import (
    Position,
    configure_message,
    frame_message,
    read_message,
    stream_url,
)
from roomsight.calls import refused
from roomsight.errors import Refused
from roomsight.events import read_event

MODEL = {"name": "lab", "version": 1, "epoch": 1, "digest": "5f0c"}
HELLO = {
    "type": "hello",
    "protocol": "roomsight.v1",
    "session": "s",
    "resumed": True,
    "next_seq": 7,
    "settings": {"model": "lab", "mode": "latest", "filter": {"trust": 0.5}},
    "limits": {
        "max_frame_bytes": 1,
        "max_frame_pixels": 1,
        "window": 8,
        "idle_timeout_ms": 1,
        "resume_ms": 1,
    },
    "modes": ["latest"],
    "model": MODEL,
    "rooms": ["kitchen"],
}
RESULT = {
    "type": "result",
    "seq": 3,
    "room": "kitchen",
    "known": True,
    "probability": 0.9,
    "probabilities": [{"room": "kitchen", "probability": 0.9}],
    "model": MODEL,
    "keypoints": 9,
    "timings_ms": {"queue": 0, "decode": 1, "features": 2, "classify": 3},
    "request_id": "s",
    "something_new": [1, 2],
}


class Messages(unittest.TestCase):
    def test_a_result_has_the_rooms_of_the_frame_and_of_the_filter(self) -> None:
        alone = read_message(json.dumps(RESULT))
        assert isinstance(alone, Result)
        self.assertEqual((alone.seq, alone.room, alone.answer.timings_ms.features), (3, "kitchen", 2))
        hall = {"room": "hall", "probability": 0.6, "probabilities": []}
        both = read_message(json.dumps({**RESULT, "filtered": {**hall, "known": False, "novelty": 0.9}}))
        self.assertEqual((both.answer.known, both.known, both.filtered.novelty), (True, False, 0.9))
        assert isinstance(both, Result)
        self.assertEqual((both.room, both.probability, both.answer.room), ("hall", 0.6, "kitchen"))
        self.assertIsNone(both.notice)
        noticed = read_message(json.dumps({**RESULT, "notice": {"kind": "stamps", "detail": "they stand still"}}))
        assert isinstance(noticed, Result) and noticed.notice is not None
        self.assertEqual((noticed.notice.kind, noticed.notice.detail), ("stamps", "they stand still"))

    def test_what_is_no_message_is_refused(self) -> None:
        cut = {name: value for name, value in RESULT.items() if name != "room"}
        for text in ["", "[]", "{}", '{"type": "goodbye"}', '{"type": "dropped"}', json.dumps(cut)]:
            with self.assertRaises(ProtocolError, msg=text):
                read_message(text)

    def test_a_dated_frame_has_a_header_and_a_bare_one_has_none(self) -> None:
        self.assertEqual(frame_message(b"image", 1, Beside()), b"image")
        header = b"RSF1" + b"\x01\0\0\0" + b"\x02" + 7 * b"\0" + b"\x03" + 7 * b"\0"
        self.assertEqual(frame_message(b"image", 2, Beside(3)), header + b"image")

    def test_odometry_and_a_scan_lie_between_the_header_and_the_image(self) -> None:
        scan = Scan(-1.5, 0.5, 8.0, [1.0, float("inf")])
        message = frame_message(b"image", 2, Beside(None, Odometry(1.0, 2.0, 3.0), scan))
        self.assertEqual(message[:24], b"RSF1" + b"\x06\0\0\0" + b"\x02" + 7 * b"\0" + 8 * b"\0")
        self.assertEqual(struct.unpack("<ddd", message[24:48]), (1.0, 2.0, 3.0))
        self.assertEqual(struct.unpack("<Ifffff", message[48:72]), (2, -1.5, 0.5, 8.0, 1.0, float("inf")))
        self.assertEqual(message[72:], b"image")
        self.assertEqual(json.loads(scan.as_json())["ranges"], [1.0, None])

    def test_what_is_left_out_is_not_sent(self) -> None:
        sent = json.loads(configure_message({"filter": False, "robot": None, "top": 0}))
        self.assertEqual(sent, {"type": "configure", "filter": False, "top": 0})
        self.assertEqual(stream_url("http://lab:80/", {"robot": None}), "ws://lab:80/v1/stream")
        self.assertEqual(stream_url("https://lab", {"robot": "a b"}), "wss://lab/v1/stream?robot=a+b")

    def test_the_last_answer_is_where_a_stream_goes_on(self) -> None:
        position = Position(read_message(json.dumps(HELLO)), ResumePoint("s", 4))  # type: ignore[arg-type]
        self.assertEqual((position.number(), position.number()), (7, 8))
        self.assertEqual(position.point, ResumePoint("s", 4, 8))
        self.assertIsInstance(position.read('{"type": "dropped", "seq": 6, "reason": "overload"}'), Dropped)
        problem = {"type": "/problems/x", "title": "X", "status": 400, "detail": "y", "request_id": "s"}
        self.assertIsInstance(position.read(json.dumps({"type": "error", "problem": problem})), Error)
        self.assertEqual(position.point, ResumePoint("s", 6, 8))

    def test_a_refusal_says_why_and_when_to_come_back(self) -> None:
        problem = {"type": "/problems/x", "title": "X", "status": 429, "detail": "y", "request_id": "s"}
        error = refused(429, json.dumps(problem).encode(), "3")
        assert isinstance(error, Refused)
        self.assertEqual((str(error), error.retry_after), ("X: y", 3.0))
        self.assertIsInstance(refused(502, b"<html>", None), ProtocolError)

    def test_events_are_read_by_their_type(self) -> None:
        told = {
            '{"type": "room_changed", "id": "eve", "from": "hall", "to": "attic"}': RoomChanged("eve", "attic", before="hall"),
            '{"type": "room_changed", "id": "eve", "to": "attic"}': RoomChanged("eve", "attic"),
            '{"type": "training", "id": 3, "model": "home", "state": "done"}': TrainingChanged(3, "home", "done"),
            '{"type": "inbox_changed", "open": 2}': InboxChanged(2),
            '{"type": "set_changed", "set": "home"}': SetChanged("home"),
            '{"type": "later", "from": 1}': OtherEvent("later", {"from": 1}),
        }
        for data, event in told.items():
            self.assertEqual(read_event(f"data: {data}"), event)
        self.assertIsNone(read_event("event: set_changed"))
        for wrong in ['{"type": "set_changed"}', "[]", "{}", "no json"]:
            with self.assertRaises(ProtocolError):
                read_event(f"data: {wrong}")
