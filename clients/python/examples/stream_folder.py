"""Streams the pictures of a folder: python stream_folder.py FOLDER."""

import sys
from pathlib import Path

from roomsight import Client, Result

with Client("http://127.0.0.1:8080") as client, client.stream(robot="folder") as stream:
    for picture in sorted(Path(sys.argv[1]).iterdir()):
        stream.send(picture)
        answer = stream.answer()
        print(picture.name, answer.room if isinstance(answer, Result) else answer)
