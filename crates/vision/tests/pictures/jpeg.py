"""A small JPEG writer, for the layouts that libraries read and do not write."""

import struct
from dataclasses import dataclass, field

import numpy as np

ZIGZAG = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21, 28,
    35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47,
    55, 62, 63,
]  # fmt: skip
WAVES = np.array(
    [[np.cos((2 * x + 1) * u * np.pi / 16) * (np.sqrt(0.5) if u == 0 else 1) / 2 for x in range(8)] for u in range(8)]
)
# Annex K's tables for luma, which do for every component: the number of codes of each length, and their symbols.
DC = (bytes.fromhex("00010501010101010100000000000000"), bytes(range(12)))
AC = (
    bytes.fromhex("0002010303020403050504040000017d"),
    bytes.fromhex(
        "01020300041105122131410613516107227114328191a1082342b1c11552d1f02433627282090a161718191a25262728292a3435363738"
        "393a434445464748494a535455565758595a636465666768696a737475767778797a838485868788898a92939495969798999aa2a3a4a5"
        "a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9fa"
    ),
)


def codes(table):
    """The code and its length for each symbol."""
    counts, symbols = table
    found, code, position = {}, 0, 0
    for length, count in enumerate(counts, 1):
        for symbol in symbols[position : position + count]:
            found[symbol] = (code, length)
            code += 1
        position += count
        code <<= 1
    return found


DC_CODES, AC_CODES = codes(DC), codes(AC)


class Bits:
    """Entropy-coded data."""

    def __init__(self):
        self.text = []

    def code(self, code, length):
        if length:
            self.text.append(format(code, f"0{length}b"))

    def value(self, value):
        size = abs(value).bit_length()
        self.code(value if value > 0 else value + (1 << size) - 1, size)

    def take(self):
        text = "".join(self.text)
        self.text = []
        text += "1" * (-len(text) % 8)
        data = bytes(int(text[at : at + 8], 2) for at in range(0, len(text), 8))
        return data.replace(b"\xff", b"\xff\x00")


def marker(kind, content=b""):
    return bytes([0xFF, kind]) + struct.pack(">H", len(content) + 2) + content


@dataclass
class Layout:
    """How a picture is laid out."""

    factors: list  # (across, down) of each component
    interleaved: bool = True
    restart_interval: int = 0
    has_tables: bool = True
    ids: bytes = b"\x01\x02\x03\x04"
    segments: list = field(default_factory=list)  # whole markers before the frame
    step: int = 4  # of the quantization
    wide_steps: bool = False  # 16 bits a step
    padding: bytes = b""  # fill bytes before markers
    seed: int = 0


def blocks_of(plane, layout):
    """Quantized coefficients of a plane whose sides are multiples of 8, block by block."""
    height, width = plane.shape
    blocks = plane.reshape(height // 8, 8, width // 8, 8).transpose(0, 2, 1, 3).astype(float) - 128
    coefficients = WAVES @ blocks @ WAVES.T / layout.step
    return np.rint(coefficients).astype(int).reshape(height // 8, width // 8, 64)[:, :, ZIGZAG]


def write_block(bits, block, last):
    difference = int(block[0]) - last
    bits.code(*DC_CODES[abs(difference).bit_length()])
    bits.value(difference)
    run = 0
    filled = np.nonzero(block)[0]
    end = int(filled[-1]) if len(filled) else 0
    for value in map(int, block[1 : end + 1]):
        if value == 0:
            run += 1
            continue
        while run > 15:
            bits.code(*AC_CODES[0xF0])
            run -= 16
        bits.code(*AC_CODES[run << 4 | abs(value).bit_length()])
        bits.value(value)
        run = 0
    if end < 63:
        bits.code(*AC_CODES[0])
    return int(block[0])


def scan(layout, parts):
    """A scan of (component index, blocks, blocks across, blocks down, groups across, groups down)."""
    content = bytes([len(parts)]) + b"".join(bytes([layout.ids[part[0]], 0]) for part in parts) + b"\0\x3f\0"
    head = layout.padding + marker(0xDA, content)
    bits, data, last = Bits(), [], [0] * 4
    columns, rows = parts[0][4:]
    for group in range(columns * rows):
        if layout.restart_interval and group and group % layout.restart_interval == 0:
            restart = (group // layout.restart_interval - 1) % 8
            data += [bits.take(), layout.padding, bytes([0xFF, 0xD0 + restart])]
            last = [0] * 4
        row, column = divmod(group, columns)
        for component, blocks, across, down, *_ in parts:
            for y in range(row * down, (row + 1) * down):
                for x in range(column * across, (column + 1) * across):
                    last[component] = write_block(bits, blocks[y, x], last[component])
    return head + b"".join(data) + bits.take()


def encode(width, height, layout):
    """A JPEG of smooth waves with some noise."""
    random = np.random.default_rng(layout.seed)
    most_across = max(across for across, _ in layout.factors)
    most_down = max(down for _, down in layout.factors)
    columns, rows = -(-width // (8 * most_across)), -(-height // (8 * most_down))
    parts, singles = [], []
    for idx, (across, down) in enumerate(layout.factors):
        x, y = np.meshgrid(np.arange(columns * across * 8), np.arange(rows * down * 8))
        waves = 128 + 70 * np.sin(x / (3 + idx) + idx + layout.seed) + 50 * np.cos(y / (4 - idx / 2))
        plane = np.clip(waves + random.normal(0, 12, waves.shape), 0, 255)
        blocks = blocks_of(plane, layout)
        parts.append((idx, blocks, across, down, columns, rows))
        own = [-(-(-(-side * factor // most)) // 8) for side, factor, most in
               ((width, across, most_across), (height, down, most_down))]  # fmt: skip
        singles.append([(idx, blocks, 1, 1, *own)])
    steps = (b"\x10" + struct.pack(">H", layout.step) * 64) if layout.wide_steps else bytes([0] + [layout.step] * 64)
    pieces = [b"\xff\xd8", *layout.segments, marker(0xDB, steps)]
    if layout.has_tables:
        pieces.append(marker(0xC4, b"\0" + DC[0] + DC[1] + b"\x10" + AC[0] + AC[1]))
    frame = struct.pack(">BHHB", 8, height, width, len(layout.factors))
    frame += b"".join(bytes([layout.ids[idx], a << 4 | d, 0]) for idx, (a, d) in enumerate(layout.factors))
    # Wide steps make it extended instead of baseline.
    pieces.append(layout.padding + marker(0xC1 if layout.wide_steps else 0xC0, frame))
    if layout.restart_interval:
        pieces.append(marker(0xDD, struct.pack(">H", layout.restart_interval)))
    is_interleaved = layout.interleaved and len(parts) > 1
    pieces += [scan(layout, group) for group in ([parts] if is_interleaved else singles)]
    return b"".join(pieces) + layout.padding + b"\xff\xd9"
