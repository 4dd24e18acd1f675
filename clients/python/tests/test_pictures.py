"""Which files of a folder `python -m roomsight` takes for pictures."""

import contextlib
import io
import os
import tempfile
import unittest
from pathlib import Path

from roomsight.__main__ import pictures


class Pictures(unittest.TestCase):
    """Folders as people have them."""

    def test_files_are_taken_by_name_or_content_and_the_rest_is_told(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "x.jpg").mkdir()
            os.mkfifo(folder / "pipe.jpg")
            files = {"1.JPG": b"x", "2": b"\xff\xd8\xff\xe0", "notes.txt": b"x", "._1.jpg": b"x"}
            files |= {"x.jpg/10.png": b"x", "x.jpg/9.png": b"x", "\N{SUPERSCRIPT TWO}1.jpeg": b"x"}
            for file, content in files.items():
                (folder / file).write_bytes(content)
            with contextlib.redirect_stderr(io.StringIO()) as told:
                found = pictures(folder)
            self.assertEqual([path.name for path in found], ["1.JPG", "2", "9.png", "10.png", "\N{SUPERSCRIPT TWO}1.jpeg"])
            self.assertIn("._1.jpg and 2 more", told.getvalue())

    def test_a_folder_without_a_picture_is_an_error(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            with self.assertRaisesRegex(ValueError, "no picture"):
                pictures(Path(name))


if __name__ == "__main__":
    unittest.main()
