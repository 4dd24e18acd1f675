"""Recognizing within this process, beside what the service says of the same frames."""

import io
import threading
import unittest
from dataclasses import asdict
from pathlib import Path

import numpy
from PIL import Image
from roomsight import Client, Result
from running import REPOSITORY, RunningService

try:
    from roomsight.core import FrameError, ModelError, Recognition, Recognizer
except ImportError as error:
    raise unittest.SkipTest(f"the part in Rust is not built: {error}") from error

MODEL = REPOSITORY / "models" / "simulated-lab" / "1"


def same(one: object, other: object) -> bool:
    """Whether two values are the same but for how numbers of 32 bits are written, and for what only the other one tells."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() <= other.keys() and all(same(one[name], other[name]) for name in one)
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return abs(one - other) <= 1e-6 * max(1.0, abs(one))
    return one == other


def by_itself(seen: Recognition) -> "dict[str, object]":
    """What a frame says by itself, which is what a service says of it."""
    told = asdict(seen)
    assert told.pop("filtered") is None
    return told


class Core(RunningService):
    """A recognizer and a service with the same model."""

    recognizer: Recognizer

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        cls.recognizer = Recognizer(MODEL)

    def assert_same(self, one: object, other: object) -> None:
        self.assertTrue(same(one, other), f"{one}\n{other}")

    def test_answers_are_those_of_the_service(self) -> None:
        with Client(self.url) as client:
            for frame in self.frames:
                self.assert_same(by_itself(self.recognizer.recognize(frame)), asdict(client.recognize(frame)))
                explained = self.recognizer.recognize(frame, top=2, explain=True)
                self.assertEqual(len(explained.probabilities), 2)
                self.assertTrue(explained.nearest)
                self.assert_same(by_itself(explained), asdict(client.recognize(frame, top=2, explain=True)))

    def test_pixels_are_seen_as_the_picture_that_they_are(self) -> None:
        for frame in self.frames[:3]:
            picture = Image.open(frame).convert("RGB")
            portable = io.BytesIO()
            picture.save(portable, "PPM")
            wanted = self.recognizer.recognize(portable.getvalue())
            rgb = numpy.asarray(picture)
            bgr = numpy.ascontiguousarray(rgb[:, :, ::-1])
            padded = numpy.zeros((rgb.shape[0], rgb.shape[1] + 7, 3), numpy.uint8)
            padded[:, :-7] = rgb
            for pixels in (picture, rgb, bgr[:, :, ::-1], padded[:, :-7], numpy.asfortranarray(rgb)):
                self.assertEqual(self.recognizer.recognize(pixels), wanted)
            gray = picture.convert("L")
            portable = io.BytesIO()
            gray.save(portable, "PPM")
            wanted = self.recognizer.recognize(portable.getvalue())
            for pixels in (gray, numpy.asarray(gray)):
                self.assertEqual(self.recognizer.recognize(pixels), wanted)

    def test_what_is_no_frame_is_told(self) -> None:
        pixels = numpy.zeros((4, 5, 3), numpy.uint8)
        for frame, told in [
            (3, "not int"),
            (pixels[:, :, :2], "4 x 5 x 2"),
            (pixels.astype(numpy.float32), "float32"),
            (Image.new("CMYK", (4, 4)), "CMYK"),
        ]:
            with self.assertRaisesRegex(TypeError, told):
                self.recognizer.recognize(frame)  # type: ignore[arg-type]
        for frame in (b"no picture", pixels[:0], numpy.lib.stride_tricks.as_strided(pixels[:1, :1, 0], (100_000, 100_000), (0, 0))):
            with self.assertRaises(FrameError):
                self.recognizer.recognize(frame)
        with self.assertRaises(FileNotFoundError):
            self.recognizer.recognize("nowhere.jpg")
        with self.assertRaises(IsADirectoryError):
            self.recognizer.recognize(REPOSITORY)

    def test_what_is_no_model_is_told(self) -> None:
        for folder in (REPOSITORY, Path("nowhere")):
            with self.assertRaisesRegex(ModelError, "holds no model that can be loaded"):
                Recognizer(folder)

    def test_threads_share_a_recognizer(self) -> None:
        alone = [self.recognizer.recognize(frame) for frame in self.frames]
        together: list[list[Recognition]] = []

        def recognize() -> None:
            together.append([self.recognizer.recognize(frame) for frame in self.frames])

        threads = [threading.Thread(target=recognize) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(together, [alone] * 4)

    def test_a_follower_says_what_a_stream_says(self) -> None:
        follower = self.recognizer.follow()
        with Client(self.url) as client, client.stream(filter=True, mode="lossless") as stream:
            for idx, frame in enumerate(self.frames):
                stream.send(frame, captured_at_ns=1_000_000_000 + idx * 500_000_000)
                result = stream.answer()
                assert isinstance(result, Result) and result.filtered is not None
                here = follower.recognize(frame, at=1.0 + idx * 0.5)
                assert here.filtered is not None
                self.assert_same(asdict(here.filtered), asdict(result.filtered))

    def test_a_follower_is_cautious_as_it_is_told(self) -> None:
        for trust in (0.0, -1.0, float("nan"), 11.0):
            with self.assertRaisesRegex(ValueError, "trust"):
                self.recognizer.follow(trust=trust)
        bold, timid = (self.recognizer.follow(trust=trust).recognize(self.frames[0]) for trust in (3.0, 0.1))
        assert bold.filtered and timid.filtered
        self.assertGreater(bold.filtered.probability, timid.filtered.probability)


if __name__ == "__main__":
    unittest.main()
