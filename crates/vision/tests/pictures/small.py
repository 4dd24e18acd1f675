"""Writes the small JPEGs beside it, which the tests of the decoder read.

    python small.py
"""

import pathlib

from jpeg import Layout, encode
from matrix import drawn, saved

TOGETHER = [(2, 2), (1, 1), (1, 1)]
UPRIGHT = [(1, 2), (1, 1), (1, 1)]
FULL = [(1, 1)] * 3

PICTURES = {
    "together": encode(80, 60, Layout(TOGETHER)),
    "apart": encode(80, 60, Layout(TOGETHER, interleaved=False)),
    "upright-together": encode(80, 60, Layout(UPRIGHT)),
    "upright-apart": encode(80, 60, Layout(UPRIGHT, interleaved=False)),
    "restarts": encode(80, 60, Layout(TOGETHER, restart_interval=2)),
    "full": encode(33, 19, Layout(FULL)),
    "full-without-tables": encode(33, 19, Layout(FULL, has_tables=False)),
    "dense-chroma": encode(33, 19, Layout([(1, 1), (2, 2), (2, 2)])),
    "inks": encode(33, 19, Layout([(1, 1)] * 4)),
    "progressive": saved(drawn(80, 60, "RGB"), "JPEG", quality=90, progressive=True),
}

for name, data in PICTURES.items():
    pathlib.Path(__file__).with_name(f"{name}.jpg").write_bytes(data)
