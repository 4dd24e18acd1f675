"""A model that looks at the scans of a laser: in this process, over REST, and over a stream."""

import subprocess
import tempfile
import unittest
from pathlib import Path

from roomsight import Client, Odometry, Refused, Result, Scan
from running import BINARY, RunningService

try:
    from roomsight.core import FrameError, Recognizer
except ImportError as error:
    raise unittest.SkipTest(f"the part in Rust is not built: {error}") from error

CONFIG = "[opinions.laser]\nkind = 'laser'\n"


class Senses(RunningService):
    """A recognizer and a service with a model that looks at scans alone."""

    recognizer: Recognizer
    pairs: "list[tuple[Path, Scan]]"

    @classmethod
    def setUpClass(cls) -> None:
        made = tempfile.TemporaryDirectory()
        cls.addClassCleanup(made.cleanup)
        folder = Path(made.name)
        lab, config, model = folder / "lab", folder / "laser.toml", folder / "models" / "lab" / "1"
        config.write_text(CONFIG)
        model.parent.mkdir(parents=True)
        drives = ["--camera=std", "--illumination=cloudy1,night1", "--frames-per-second=0.2"]
        train = ["--laser", "--config", config, "-o", model]
        for arguments in (["simulate", lab, *drives], ["train", lab, *train]):
            subprocess.run([BINARY, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        frames = sorted((lab / "cold-saarbruecken/part_b/seq3_night1/std_cam").iterdir())
        lines = (lab / "cold-saarbruecken/part_b/seq3_night1/odom_scans/scans.tdf").read_text().splitlines()
        degree = 0.017453292519943295
        cls.pairs = [
            (frame, Scan(-90 * degree, degree, 81.0, [float(field) for field in line.split()[-181:]]))
            for frame, line in zip(frames, lines)
        ][::4]
        cls.models = folder / "models"
        super().setUpClass()
        cls.recognizer = Recognizer(model)

    def test_all_ways_say_the_same(self) -> None:
        rooms = set()
        with Client(self.url) as client, client.stream(mode="lossless", filter=False) as stream:
            for frame, scan in self.pairs:
                seen = self.recognizer.recognize(frame, scan=scan)
                rooms.add(seen.room)
                stream.send(frame, scan=scan)
                streamed = stream.answer()
                self.assertIsInstance(streamed, Result)
                for other in (client.recognize(frame, scan=scan), streamed.answer):  # type: ignore[union-attr]
                    self.assertEqual((other.room, other.known), (seen.room, seen.known))
                    self.assertAlmostEqual(other.probability, seen.probability, places=5)
                without = self.recognizer.recognize(frame)
                self.assertEqual((without.known, without.unknown), (False, "no_detail"))
        self.assertGreater(len(rooms), 1)

    def test_a_robot_that_stands_is_believed_to_stay(self) -> None:
        (frame, scan), place = self.pairs[0], Odometry(1.0, 2.0, 0.5)
        for odometry, stays in ((place, True), (None, False)):
            follower = self.recognizer.follow()
            for second in range(3):
                first = follower.recognize(frame, at=float(second), scan=scan)
            assert first.filtered is not None
            follower.recognize(frame, at=3.0, odometry=odometry)
            late = follower.recognize(frame, at=120.0, odometry=odometry).filtered
            assert late is not None
            self.assertEqual(late.room == first.filtered.room and late.probability > 0.8, stays, f"{late}")

    def test_scans_of_another_laser_are_refused(self) -> None:
        frame, scan = self.pairs[0]
        narrow = Scan(-0.5, 0.01, 8.0, [1.0] * 100)
        with Client(self.url) as client:
            for wrong, reason in ((narrow, "covers 57 degrees"), (Scan(0.0, 0.0, 8.0, [1.0] * 100), "radians")):
                with self.assertRaisesRegex(Refused, reason):
                    client.recognize(frame, scan=wrong)
                with self.assertRaisesRegex(FrameError, reason):
                    self.recognizer.recognize(frame, scan=wrong)
