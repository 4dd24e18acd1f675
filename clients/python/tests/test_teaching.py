"""Rooms are taught by both clients, with a real service and little pictures."""

import asyncio
import io
import shutil
import tempfile
import threading
import unittest
from collections.abc import Awaitable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from roomsight import (
    AsyncClient,
    Client,
    Event,
    InboxChanged,
    LearningPolicy,
    Refused,
    SetChanged,
    TrainingChanged,
)
from running import PATIENCE_S, RunningService

ROOMS = ["bars", "dots", "stripes"]


def view(room: str, shift: int) -> Any:
    """The pixels of a view of a room, which is told by its pattern."""
    row, column = np.mgrid[0:72, 0:96]
    y, x = row + shift // 24 % 24, column + shift % 24
    bright = {
        "bars": (y % 24 < 6) & (x % 12 < 9),
        "dots": (x % 12 < 4) & (y % 12 < 4),
        "stripes": (x % 24 < 6) & (y % 12 < 9),
    }[room]
    return np.where(bright, 200, 40 + (column * 31 + row * 17 + shift) % 5).astype(np.uint8)


def encoded(room: str, shift: int) -> bytes:
    """The same as a PNG."""
    png = io.BytesIO()
    Image.fromarray(view(room, shift)).save(png, format="png")
    return png.getvalue()


class TaughtService(RunningService):
    """A service that keeps data, and models of its own."""

    @classmethod
    def setUpClass(cls) -> None:
        kept = tempfile.TemporaryDirectory()
        cls.addClassCleanup(kept.cleanup)
        cls.models = Path(kept.name) / "models"
        shutil.copytree(RunningService.models, cls.models)
        cls.data = Path(kept.name) / "data"
        cls.arguments = ["--data", str(cls.data)]
        super().setUpClass()

    async def is_refused(self, status: int, call: Awaitable[Any]) -> None:
        """Holds that a call is refused with this status."""
        with self.assertRaises(Refused) as refused:
            await call
        self.assertEqual(refused.exception.problem.status, status)


class Sets(TaughtService, unittest.IsolatedAsyncioTestCase):
    """Data sets."""

    def test_frames_of_any_kind_are_added_and_what_is_not_taken_is_told(self) -> None:
        with Client(self.url) as client, tempfile.TemporaryDirectory() as folder:
            self.assertEqual(client.sets.create("any").frames, 0)
            path = Path(folder) / "ein \"Küchen\"bild;.png"
            path.write_bytes(encoded("dots", 1))
            frames = [path, str(path), encoded("bars", 2), view("bars", 3), b"this is no image"]
            added = client.sets.add_frames("any", iter(frames), room="Küche", drive="monday")
            self.assertEqual([len(added.added), len(added.changes)], [3, 1])
            self.assertEqual([(copy.name, copy.path) for copy in added.copies], [(str(path), added.added[0])])
            self.assertEqual([refused.name for refused in added.refused], ["4"])
            for one in [str(path), encoded("bars", 2), view("bars", 3)]:
                copies = client.sets.add_frames("any", one, room="Küche", drive="monday")
                self.assertEqual((len(copies.copies), copies.added, copies.changes), (1, [], []))
            self.assertEqual(client.sets.picture("any", added.added[1]), encoded("bars", 2))
            with Image.open(io.BytesIO(client.sets.picture("any", added.added[1], width=32))) as small:
                self.assertEqual((small.format, small.width), ("JPEG", 32))

    def test_many_frames_take_several_requests_and_changes(self) -> None:
        with Client(self.url) as client:
            client.sets.create("many")
            frames = [view("bars", shift) for shift in range(40)]
            added = client.sets.add_frames("many", frames, room="bars")
            self.assertEqual((len(added.added), len(added.changes)), (40, 3))
            first = client.sets.frames("many", limit=30)
            rest = client.sets.frames("many", after=first.next)
            self.assertEqual((first.total, len(first.frames), rest.next), (40, 30, None))
            listed = [frame.path for frame in first.frames + rest.frames]
            self.assertEqual(listed, sorted(added.added))
            self.assertEqual(client.sets.add_frames("many", [], room="bars").added, [])

    async def test_sets_are_changed_and_changes_undone(self) -> None:
        async with AsyncClient(self.url) as client:
            sets = client.sets
            await sets.create("changed")
            added = (await sets.add_frames("changed", [view("dots", 1), view("dots", 2)], room="a", drive="x")).added
            moved = await sets.move("changed", added[:1], room="b", drive="y")
            self.assertEqual((moved.action, moved.frames, moved.undone), ("move", 1, False))
            await sets.rename_drive("changed", "b", "y", "z")
            await sets.rename_room("changed", "b", "c")
            self.assertEqual([(frame.room, frame.drive) for frame in (await sets.frames("changed", room="c")).frames], [("c", "z")])
            removed = await sets.remove_room("changed", "c")
            await sets.remove_frames("changed", added[1:])
            self.assertEqual((await sets.frames("changed")).total, 0)
            self.assertTrue((await sets.undo("changed", removed.id)).undone)
            shown = await sets.show("changed")
            self.assertEqual([(room.name, [drive.name for drive in room.drives]) for room in shown.rooms], [("c", ["z"])])
            self.assertEqual([change.action for change in shown.changes][:2], ["remove", "remove_room"])
            self.assertTrue(shown.advice)
            await self.is_refused(409, sets.remove_frames("changed", added))
            self.assertIn("changed", [line.name for line in await sets.list()])
            await sets.remove("changed")
            self.assertNotIn("changed", [line.name for line in await sets.list()])
            await self.is_refused(404, sets.show("changed"))
            for name in ["../changed", "a/b", "a b", "", ".", ".."]:
                with self.assertRaises(Refused):
                    await sets.show(name)

    async def test_a_set_is_checked(self) -> None:
        async with AsyncClient(self.url) as client:
            await client.sets.create("odd")
            for room in ["bars", "dots"]:
                await client.sets.add_frames("odd", [view(room, 7 * shift) for shift in range(6)], room=room)
            # The same picture, but not the same file.
            await client.sets.add_frames("odd", encoded("bars", 0), room="dots")
            self.assertEqual((await client.sets.show_check("odd")).state, "none")
            check = await client.sets.begin_check("odd")
            while check.state == "running":
                await asyncio.sleep(0.1)
                check = await client.sets.show_check("odd")
            self.assertEqual(check.state, "done", check.error)
            others = {finding.path: finding.other for finding in check.findings if finding.other}
            self.assertTrue(any({path[:4], str(other)[:4]} == {"bars", "dots"} for path, other in others.items()), check)


class Trainings(TaughtService, unittest.IsolatedAsyncioTestCase):
    """From pictures to a model that answers, and to one that learns from what the first got wrong."""

    def test_rooms_are_taught_trained_published_and_served(self) -> None:
        with Client(self.url) as client, client.events() as events:
            told: list[Event] = []
            reading = threading.Thread(target=lambda: told.extend(events))
            reading.start()
            client.sets.create("home")
            for room in ROOMS:
                client.sets.add_frames("home", [view(room, 7 * n) for n in range(8)], room=room, drive="monday")
            begun = client.trainings.begin("home", model="home", effort="fast")
            self.assertEqual((begun.state, begun.set, begun.effort), ("running", "home", "fast"))
            with self.assertRaises(TimeoutError):
                client.trainings.wait(begun.id, timeout=0.0)
            trained = client.trainings.wait(begun.id, PATIENCE_S)
            self.assertEqual((trained.state, trained.n_frames), ("done", 24), trained.error)
            assert trained.report is not None and trained.rate is not None
            self.assertIn("card", trained.report)
            version = client.trainings.publish(trained.id)
            self.assertEqual((version.name, version.version), ("home", 1))
            self.assertEqual(client.trainings.list()[0].published, version)
            self.assertIsNone(client.model("home").serving)
            client.activate(version.name, version.version)
            answer = client.recognize(view("bars", 3), model="home", robot="eve")
            self.assertEqual(answer.room, "bars")
            self.assertEqual(client.robot_frame("eve"), b"P5 96 72 255\n" + view("bars", 3).tobytes())
            self.assertEqual(client.audit(limit=2).entries[0].what, "activate")
            newer = client.audit(limit=2)
            assert newer.next is not None
            older = client.audit(before=newer.next).entries
            self.assertEqual((older[-1].what, older[0].id < newer.entries[-1].id), ("set_created", True))
            events.close()
            reading.join(PATIENCE_S)
            self.assertIn(SetChanged("home"), told)
            states = [event.state for event in told if isinstance(event, TrainingChanged)]
            self.assertEqual((states[0], states[-1]), ("running", "done"))

    async def test_a_training_that_fails_or_is_cancelled_is_told(self) -> None:
        async with AsyncClient(self.url) as client:
            await client.sets.create("one")
            await client.sets.add_frames("one", view("bars", 20), room="bars")
            await self.is_refused(400, client.trainings.begin("one", model="one"))
            for room in ROOMS:
                await client.sets.add_frames("one", [view(room, n) for n in range(12)], room=room)
            begun = await client.trainings.begin("one", model="one")
            await self.is_refused(409, client.trainings.begin("one", model="one"))
            await client.trainings.cancel(begun.id)
            self.assertEqual((await client.trainings.wait(begun.id, PATIENCE_S)).state, "cancelled")
            # A disk went bad, or somebody copied something else over the pictures.
            for picture in (self.data / "sets" / "one").rglob("*.*"):
                picture.write_bytes(b"no picture")
            begun = await client.trainings.begin("one", model="one")
            failed = await client.trainings.wait(begun.id, PATIENCE_S)
            self.assertEqual(failed.state, "failed")
            self.assertIn("frames can be used", failed.error or "")
            await self.is_refused(409, client.trainings.publish(begun.id))
            await self.is_refused(404, client.trainings.show(999))


class InboxAndService(TaughtService, unittest.IsolatedAsyncioTestCase):
    """What the model doubted, and what the service tells of itself."""

    async def test_doubted_frames_are_labeled(self) -> None:
        async with AsyncClient(self.url) as client:
            events = await client.events()
            inbox = client.inbox
            rule = await inbox.set_rule(replace(await inbox.rule(), all=True, robots=["eve"], probability=1.0))
            self.assertEqual((rule.all, rule.robots, rule.probability), (True, ["eve"], 1.0))
            self.assertEqual(await inbox.rule(), rule)
            frames = [encoded("bars", 1), encoded("dots", 2), encoded("dots", 3)]
            for frame in frames:
                wrong = await inbox.wrong(frame, robot="eve", right="hall")
                self.assertEqual((wrong.reasons, wrong.said, wrong.robot), (["wrong"], "hall", "eve"))
                self.assertEqual(await inbox.picture(wrong.id), frame)
            async for event in events:
                if event == InboxChanged(3):
                    break
            listed = await inbox.list(reason="wrong", robot="eve", sort="newest", limit=2)
            self.assertEqual((listed.total, listed.open, len(listed.frames)), (3, 3, 2))
            last = (await inbox.list(reason="wrong", sort="newest", after=listed.next)).frames
            self.assertEqual(len(last), 1)
            labeled = await inbox.label(listed.frames, set="labeled", room="hall", drive="today")
            label = labeled.labeled[0].label
            assert label is not None and labeled.change is not None
            self.assertEqual((len(labeled.labeled), label.set, label.room), (2, "labeled", "hall"))
            self.assertEqual((await client.sets.frames("labeled", room="hall", drive="today")).total, 2)
            # What was labeled or thrown away since it was listed stays as it is.
            self.assertEqual(await inbox.discard([*listed.frames, *last]), 1)
            late = await inbox.label([listed.frames[0], *last], set="labeled", room="attic")
            conflicts = {conflict.id: conflict.label for conflict in late.conflicts}
            self.assertEqual((late.labeled, late.change), ([], None))
            self.assertEqual(conflicts, {listed.frames[0].id: label, last[0].id: None})
            self.assertEqual((await inbox.list(state="labeled")).total, 2)
            await client.sets.undo("labeled", labeled.change)
            again = await inbox.label((await inbox.list(reason="wrong")).frames, set="labeled", room="attic")
            self.assertEqual((len(again.labeled), again.conflicts), (2, []))

    def test_the_policy_is_kept(self) -> None:
        with Client(self.url) as client:
            self.assertEqual(client.inbox.policy(), LearningPolicy())
            client.sets.create("home")
            policy = LearningPolicy(set="home", model="home", train_after=1000, publish="shadow", effort="fast", camera="equirectangular")
            self.assertEqual(client.inbox.set_policy(policy), policy)
            self.assertEqual(client.inbox.policy(), policy)
            with self.assertRaises(Refused):
                client.inbox.set_policy(replace(policy, publish="everywhere"))

    async def test_the_service_tells_of_itself(self) -> None:
        async with AsyncClient(self.url) as client:
            service = await client.service()
            self.assertTrue(service.data and not service.keys and service.uptime_s > 0.0)
            self.assertEqual((await client.service_history()).interval_s, 10)
            await self.is_refused(404, client.robot_frame("nobody"))
            await client.recognize(encoded("bars", 1), robot="wall-e")
            self.assertEqual(await client.robot_frame("wall-e"), encoded("bars", 1))
            with Image.open(io.BytesIO(await client.robot_frame("wall-e", width=48))) as small:
                self.assertEqual((small.format, small.width), ("JPEG", 48))


class Keys(TaughtService):
    """Keys of a service that had none."""

    def test_keys_are_made_and_revoked(self) -> None:
        with Client(self.url) as anyone:
            with self.assertRaises(Refused) as refused:
                anyone.keys.make("eve", "robot")
            self.assertEqual(refused.exception.problem.status, 409)
            anna = anyone.keys.make("anna", "admin")
        self.assertNotIn(anna.key, repr(anna))
        with Client(self.url, key=anna.key) as client:
            eve = client.keys.make("eve", "robot", robots=["eve", "wall-e"])
            told = [(key.name, key.role, key.robots, key.origin) for key in client.keys.list()]
            self.assertEqual(told, [("anna", "admin", [], "page"), ("eve", "robot", ["eve", "wall-e"], "page")])
            with Client(self.url, key=eve.key) as robot:
                self.assertTrue(robot.recognize(encoded("bars", 1), robot="eve").room)
                with self.assertRaises(Refused):
                    robot.keys.list()
                client.keys.revoke("eve")
                with self.assertRaises(Refused) as refused:
                    robot.recognize(encoded("bars", 1), robot="eve")
                self.assertEqual(refused.exception.problem.status, 401)
        with Client(self.url) as nobody, self.assertRaises(Refused):
            nobody.sets.list()
