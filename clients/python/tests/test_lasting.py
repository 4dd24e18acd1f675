"""Streams that go on by themselves, with a service that is killed meanwhile."""

import threading
import unittest
from collections import deque

from roomsight import (
    AsyncClient,
    Client,
    ConnectionLost,
    Dropped,
    Error,
    Hello,
    ModelName,
    Result,
    StreamLimits,
    StreamSettings,
)
from roomsight.lasting import Endings, may_pass, waits

from running import PATIENCE_S, RunningService


class LastingTest(RunningService, unittest.IsolatedAsyncioTestCase):
    settings = ["resume_keys=0123456789abcdef0123456789abcdef"]

    def restart(self) -> None:
        """Kills the service; a new one, which knows of no stream, comes a while later."""
        self.process.kill()
        self.process.wait()
        later = threading.Timer(0.3, self.start)
        later.start()
        self.addCleanup(later.join)

    def test_a_stream_goes_on_with_its_filter(self) -> None:
        with Client(self.url) as client:
            with client.lasting_stream(robot="wall-e", mode="lossless", top=2, patience_s=PATIENCE_S) as stream:
                before = [self.answered(stream.send(frame), stream.answer(PATIENCE_S)) for frame in self.frames[:2]]
                session = stream.hello.session
                self.restart()
                # What goes out before the client sees that the service is gone is lost with it.
                sent = [stream.send(frame) for frame in self.frames]
                answers = [stream.answer(PATIENCE_S) for _ in sent]
                self.assertEqual([answer.seq for answer in answers], sent)
                self.assertTrue(all(isinstance(answer, Result) or answer.reason == "lost" for answer in answers
                                    if not isinstance(answer, Error)))
                after = self.answered(stream.send(self.frames[0]), stream.answer(PATIENCE_S))
                self.assertNotEqual(stream.hello.session, session)
                self.assertTrue(stream.hello.resumed)
                self.assertEqual((stream.hello.filter, stream.hello.settings.top), ("kept", 2))
                self.assertGreater(after.seq, before[-1].seq)

    async def test_the_same_without_blocking(self) -> None:
        async with AsyncClient(self.url) as client:
            async with await client.lasting_stream(robot="eve", mode="lossless", patience_s=PATIENCE_S) as stream:
                self.answered(await stream.send(self.frames[0]), await stream.answer(PATIENCE_S))
                self.restart()
                sent = [await stream.send(frame) for frame in self.frames]
                answers = [await stream.answer(PATIENCE_S) for _ in sent]
                self.assertEqual([answer.seq for answer in answers], sent)
                self.answered(await stream.send(self.frames[0]), await stream.answer(PATIENCE_S))
                self.assertTrue(stream.hello.resumed)

    def test_patience_ends(self) -> None:
        with Client(self.url) as client, client.lasting_stream(patience_s=0.2) as stream:
            self.process.kill()
            self.process.wait()
            with self.assertRaises(ConnectionLost):
                stream.answer(PATIENCE_S)
        self.start()

    def answered(self, seq: int, answer: "Result | Dropped | Error") -> Result:
        assert isinstance(answer, Result), answer
        self.assertEqual(answer.seq, seq)
        return answer


class EndingsTest(unittest.TestCase):
    def hello(self, next_seq: int, resumed: bool) -> Hello:
        settings, limits = StreamSettings("home", "latest"), StreamLimits(1, 1, 1, 1, 1)
        model = ModelName("home", 1, 1, "0")
        return Hello("roomsight.v1", "s", resumed, next_seq, settings, limits, [], model, [])

    def test_what_the_service_does_not_know_is_lost_after_what_it_does(self) -> None:
        endings = Endings(self.hello(0, False))
        sent = [endings.number() for _ in range(5)]
        self.assertTrue(endings.is_new(Dropped(0, "superseded")))
        endings.go_on(self.hello(3, True))
        self.assertIsNone(endings.next_lost(), "1 and 2 come first")
        self.assertEqual([endings.is_new(Dropped(seq, "lost")) for seq in (0, 1, 2, 2)], [False, True, True, False])
        self.assertEqual([endings.next_lost() for _ in sent], [3, 4, None, None, None])
        endings.forget(endings.number())
        self.assertEqual(endings.number(), 6)
        endings.go_on(self.hello(0, False))
        self.assertEqual((endings.next_lost(), endings.number()), (6, 7))

    def test_waits_grow_and_end_and_a_refusal_is_no_matter_of_patience(self) -> None:
        self.assertEqual(list(waits(-1.0)), [])
        first = deque(wait for _, wait in zip(range(9), waits(3600.0)))
        self.assertTrue(all(0.0 <= wait <= 5.0 for wait in first) and first[0] <= 0.1)
        codes = {code: may_pass(ConnectionLost("", code)) for code in (None, 1001, 1008, 1009, 1013)}
        self.assertEqual(codes, {None: True, 1001: True, 1008: False, 1009: False, 1013: True})
