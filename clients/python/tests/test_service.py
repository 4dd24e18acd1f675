"""Both clients against the real service, with simulated frames."""

import asyncio
import io
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
from PIL import Image
from roomsight import AnswerEvent, AsyncClient, Client, ConnectionLost, Dropped, Error, Refused, Result, RoomsightError
from running import PATIENCE_S, RunningService

NO_IMAGE = b"this is no image"


class Service(RunningService, unittest.IsolatedAsyncioTestCase):
    """Both clients against one service."""

    def test_single_frames_and_models(self) -> None:
        with Client(self.url) as client:
            models = client.models()
            self.assertEqual(models.default, "simulated-lab")
            rooms = models.models[0].versions[0].rooms or []
            answer = client.recognize(self.frames[0], robot="wall-e", top=2)
            self.assertIn(answer.room, rooms)
            self.assertEqual((answer.robot, len(answer.probabilities)), ("wall-e", 2))
            with self.assertRaises(Refused) as refused:
                client.recognize(NO_IMAGE)
            self.assertEqual(refused.exception.problem.type, "/problems/not-an-image")
            with self.assertRaises(Refused):
                client.recognize(self.frames[0], model="nowhere")

    async def test_the_same_without_blocking(self) -> None:
        async with AsyncClient(self.url) as client:
            self.assertTrue(await client.is_ready())
            answer = await client.recognize(self.frames[0].read_bytes())
            with Client(self.url) as blocking:
                self.assertEqual(blocking.recognize(self.frames[0]).probabilities, answer.probabilities)
            with self.assertRaises(Refused):
                await client.recognize(NO_IMAGE)

    def test_a_stream_answers_every_frame_in_order(self) -> None:
        with Client(self.url) as client, client.stream(robot="wall-e", mode="lossless") as stream:
            sent = [stream.send(frame, captured_at_ns=time.time_ns()) for frame in self.frames]
            answers = [stream.answer(PATIENCE_S) for _ in sent]
            self.assertEqual([answer.seq for answer in answers], sent)
            for answer, frame in zip(answers, self.frames):
                assert isinstance(answer, Result), answer
                self.assertEqual(answer.answer.room, client.recognize(frame).room)
                self.assertIn(answer.room, stream.hello.rooms)
                self.assertIsNotNone(answer.age_ms)

    def test_pixels_in_memory_are_frames(self) -> None:
        gray = np.arange(96 * 64, dtype=np.uint8).reshape(64, 96)
        color = np.stack([gray, gray[::-1], gray[:, ::-1]], axis=2)
        with Client(self.url) as client:
            for pixels in [gray, color]:
                image = Image.fromarray(pixels)
                png = io.BytesIO()
                image.save(png, format="png")
                expected = client.recognize(png.getvalue()).probabilities
                # What is not laid out row by row is sent row by row.
                for frame in [pixels, image, pixels.T.copy().T]:
                    self.assertEqual(client.recognize(frame).probabilities, expected)
            palette = Image.fromarray(gray).convert("P")
            for wrong in [gray.astype(np.float32), color[:, :, :2], 3, palette]:
                with self.assertRaises(TypeError):
                    client.recognize(wrong)

    def test_answers_are_explained(self) -> None:
        with Client(self.url) as client:
            self.assertIsNone(client.recognize(self.frames[0]).nearest)
            nearest = client.recognize(self.frames[0], explain=True).nearest
            assert nearest, "the model keeps what it has learned"
            self.assertGreater(nearest[0].nearness, 0.0)
            with client.stream(mode="lossless", explain=True, top=1) as stream:
                stream.send(self.frames[0])
                result = stream.answer(PATIENCE_S)
                assert isinstance(result, Result), result
                self.assertEqual(result.answer.nearest, nearest)

    def test_robots_and_events(self) -> None:
        with Client(self.url) as client, Client(self.url) as reader:
            events = reader.events()
            with client.stream(robot="eve", mode="lossless") as stream:
                told: list[AnswerEvent] = []
                answers = (event for event in events if isinstance(event, AnswerEvent))
                thread = threading.Thread(target=lambda: told.append(next(answers)))
                thread.start()
                while thread.is_alive():
                    stream.send(self.frames[0])
                    stream.answer(PATIENCE_S)
                    thread.join(0.05)
                robot = next(robot for robot in client.robots() if robot.robot == "eve")
                self.assertIn(robot.id, [robot.id for robot in client.robots(fleet=True)])
                self.assertTrue(robot.connected and robot.frames.accepted == robot.frames.results > 0)
                self.assertEqual(robot.answers[0].room, robot.room)
            events.close()
            self.assertEqual([answer.robot for answer in told], ["eve"])

    def test_events_end_where_they_or_their_client_are_closed(self) -> None:
        for closes_client in [False, True]:
            client = Client(self.url)
            events = client.events()
            ended = threading.Event()
            thread = threading.Thread(target=lambda: (list(events), ended.set()), daemon=True)
            thread.start()
            # Long enough to wait for an event, of which there are none.
            time.sleep(0.2)
            (client if closes_client else events).close()
            thread.join(PATIENCE_S / 4)
            self.assertTrue(ended.is_set(), f"closes_client {closes_client}")
            self.assertEqual(list(events), [])
            client.close()

    async def test_events_that_are_awaited_end_too(self) -> None:
        for closes_client in [False, True]:
            client = AsyncClient(self.url)
            events = await client.events()

            async def read() -> "list[object]":
                return [event async for event in events]

            reading = asyncio.ensure_future(read())
            await asyncio.sleep(0.2)
            await (client if closes_client else events).close()
            self.assertEqual(await asyncio.wait_for(reading, PATIENCE_S / 4), [], f"closes_client {closes_client}")
            await client.close()

    def test_events_end_with_their_with_and_without(self) -> None:
        with Client(self.url) as client:
            with client.events() as events, client.stream(robot="eve", mode="lossless") as stream:
                stream.send(self.frames[0])
                self.assertIsNotNone(next(events))
            with Client(f"{self.url}/nowhere") as elsewhere, self.assertRaises(RoomsightError):
                elsewhere.events()

    async def test_one_version_and_one_robot(self) -> None:
        with Client(self.url) as client, client.stream(robot="eve", mode="lossless") as stream:
            version = client.version("simulated-lab", 1)
            assert version.card is not None
            self.assertTrue(version.card["simulated"])
            self.assertIn("ready", [change.state for change in version.history])
            self.assertIsNone(version.failure)
            self.assertIsNone(version.shadow)
            async with AsyncClient(self.url) as other:
                self.assertEqual(await other.version("simulated-lab", 1), version)
                self.assertEqual((await other.robot(stream.hello.stream)).robot, "eve")
            self.assertEqual(client.robot(stream.hello.stream).stream, stream.hello.stream)
            for nothing in [lambda: client.version("simulated-lab", 9), lambda: client.robot("nobody/../x")]:
                with self.assertRaises(Refused) as refused:
                    nothing()
                self.assertEqual(refused.exception.problem.status, 404)

    async def test_models_are_changed_where_nobody_else_has(self) -> None:
        async with AsyncClient(self.url) as client:
            model = await client.model("simulated-lab")
            serving = await client.activate(model.name, model.versions[0].version, epoch=model.epoch)
            self.assertEqual((serving.version, serving.labels), (model.serving, ["stable"]))
            with self.assertRaises(Refused) as refused:
                await client.activate(model.name, model.versions[0].version, epoch=model.epoch + 100)
            self.assertEqual(refused.exception.problem.status, 412)
            with Client(self.url) as blocking:
                with self.assertRaisesRegex(Refused, "is stable"):
                    blocking.set_label(model.name, "shadow", model.versions[0].version)
                self.assertEqual(blocking.remove_label(model.name, "canary").serving, model.serving)
                self.assertTrue(blocking.make_default(model.name).default)
                with self.assertRaises(Refused):
                    blocking.upload("another", 1, b"no archive")
                with self.assertRaises(Refused):
                    blocking.delete(model.name, 999)
            with self.assertRaises(Refused):
                await client.roll_back(model.name, epoch=99)

    def test_a_bad_frame_is_answered_and_the_stream_lives(self) -> None:
        with Client(self.url) as client, client.stream(filter=False) as stream:
            stream.send(NO_IMAGE)
            bad = stream.answer(PATIENCE_S)
            assert isinstance(bad, Error), bad
            self.assertEqual((bad.seq, bad.problem.type), (0, "/problems/not-an-image"))
            with self.assertRaises(FileNotFoundError):
                stream.send("no such file.jpg")
            self.assertEqual(stream.send(self.frames[0]), 1, "what could not be sent took no number")
            good = stream.answer(PATIENCE_S)
            assert isinstance(good, Result), good
            self.assertEqual(good.seq, 1)
            self.assertIsNone(good.filtered)

    def test_a_stream_goes_on_after_its_connection_broke(self) -> None:
        with Client(self.url) as client:
            stream = client.stream(robot="wall-e")
            stream.send(self.frames[0])
            stream.answer(PATIENCE_S)
            # As when the radio is gone: without a word.
            stream._socket.socket.shutdown(socket.SHUT_RDWR)
            with self.assertRaises(ConnectionLost) as lost:
                stream.answer(PATIENCE_S)
            assert lost.exception.point is not None
            with client.resume(lost.exception.point) as resumed:
                self.assertTrue(resumed.hello.resumed)
                self.assertEqual(resumed.hello.session, stream.hello.session)
                self.assertEqual(resumed.hello.stream, stream.hello.stream)
                self.assertNotEqual(resumed.hello.stream, resumed.hello.session)
                seq = resumed.send(self.frames[1])
                self.assertEqual((seq, resumed.answer(PATIENCE_S).seq), (1, 1))

    async def test_a_stream_without_blocking(self) -> None:
        async with AsyncClient(self.url) as client:
            async with await client.stream(mode="latest", top=1) as stream:
                sent = [await stream.send(frame) for frame in self.frames]
                answers = [await stream.answer(PATIENCE_S) for _ in sent]
                self.assertEqual([answer.seq for answer in answers], sent)
                for answer in answers:
                    assert isinstance(answer, (Result, Dropped)), answer
                assert isinstance(answers[-1], Result)
                self.assertEqual(len(answers[-1].answer.probabilities), 1)

    def test_the_command_streams_a_folder(self) -> None:
        folder = str(self.frames[0].parent)
        command = [sys.executable, "-m", "roomsight", folder, "--url", self.url, "--rate", "100"]
        told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        self.assertTrue(told.startswith(self.frames[0].name), told)

    def test_the_command_names_pictures_by_their_folder_and_takes_rates_above_nothing(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            for room in ["kitchen", "office"]:
                (Path(name) / room).mkdir()
                shutil.copy(self.frames[0], Path(name) / room / "1.jpeg")
            command = [sys.executable, "-m", "roomsight", name, "--url", self.url, "--rate"]
            told = subprocess.run([*command, "100"], check=True, capture_output=True, text=True).stdout
            self.assertEqual([line.split("  ")[0] for line in told.splitlines()], ["kitchen/1.jpeg", "office/1.jpeg"])
            for rate in ["0", "-1", "nan", "inf", "fast"]:
                refused = subprocess.run([*command, rate], capture_output=True, text=True)
                self.assertEqual(refused.returncode, 2)
                self.assertIn("frames a second", refused.stderr)

    def test_an_address_where_nothing_is_is_told(self) -> None:
        with Client("http://127.0.0.1:1") as client:
            with self.assertRaises(ConnectionLost):
                client.recognize(self.frames[0])
            with self.assertRaises(ConnectionLost):
                client.stream()
        with self.assertRaises(ValueError):
            Client("127.0.0.1:8080")
