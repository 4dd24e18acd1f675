"""The commands from Python: what they report, how far they are, and how they fail."""

import logging
import os
import subprocess
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from roomsight import program
from running import BINARY, REPOSITORY


class Program(unittest.TestCase):
    """A short drive of the simulated lab, by the program of the tests."""

    folder: Path

    @classmethod
    def setUpClass(cls) -> None:
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        named = mock.patch.dict(os.environ, ROOMSIGHT=BINARY)
        named.start()
        cls.addClassCleanup(named.stop)
        drive = ["--camera=omni", "--illumination=cloudy1", "--frames-per-second=0.2"]
        subprocess.run([BINARY, "simulate", folder.name, *drive], check=True, stdout=subprocess.DEVNULL)

    def test_train_and_evaluate(self) -> None:
        steps: list[tuple[str, int, int]] = []
        model = self.folder / "model"
        report = program.train(self.folder, model, progress=lambda *step: steps.append(step), set={"representation.n_words": 50, "seed": 3})
        self.assertEqual(report["model"], str(model))
        self.assertGreater(report["held_out"]["overall"]["rate"], 0.5)
        self.assertEqual({what for what, _, _ in steps}, {"describing frames", "training"})
        self.assertTrue(all(0 <= done <= of for _, done, of in steps), steps)
        rates = program.evaluate(model, self.folder, sequences="*cloudy1")
        self.assertEqual(rates["n_learned"], rates["evaluation"]["overall"]["n_frames"])

    def test_failures_are_told(self) -> None:
        with self.assertRaisesRegex(program.ProgramError, "nowhere") as raised:
            program.evaluate("nowhere", self.folder)
        self.assertEqual(raised.exception.exit_code, 1)
        with self.assertRaisesRegex(program.ProgramError, "--no-such-option") as raised:
            program.run("train", self.folder, no_such_option=True)
        self.assertEqual(raised.exception.exit_code, 2)
        with self.assertRaisesRegex(program.ProgramError, "min-known") as raised:
            program.train(self.folder, self.folder / "gated", set={"representation.n_words": 50}, min_known=0.9999)
        self.assertEqual(raised.exception.exit_code, 3)

    def test_notes_are_logged(self) -> None:
        with self.assertLogs("roomsight", logging.INFO) as logged:
            program.evaluate(REPOSITORY / "models" / "simulated-lab", self.folder)
        self.assertRegex(logged.output[0], "taking the highest version")

    def test_options_are_those_of_the_command_line(self) -> None:
        options = {"min_rate": 0.5, "no_golden_frames": True, "json": False, "add": None, "set": {"a.b": True, "c": [1]}, "test": ["*a", Path("b")]}
        self.assertEqual(
            program.flags(options),
            ["--min-rate=0.5", "--no-golden-frames", "--set=a.b=true", "--set=c=[1]", "--test=*a", "--test=b"],
        )


if __name__ == "__main__":
    unittest.main()
