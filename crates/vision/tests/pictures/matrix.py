"""Writes pictures of every kind into a folder, each with the luma and the colors that Pillow reads in it.

    python matrix.py FOLDER

A picture NAME has its luma in NAME.luma: width and height as 32-bit numbers, least byte first, then the pixels.
Where it has colors, red, green and blue of each pixel follow.
Pictures that Pillow does not read are left out.
"""

import io
import itertools
import pathlib
import struct
import sys
import warnings
import zlib

import numpy as np
from jpeg import Layout, encode, marker
from PIL import Image, ImageOps

ADOBE = b"Adobe\0\x64\0\0\0\0"
JFIF = marker(0xE0, b"JFIF\0\1\1\0\0\1\0\1\0\0")
XMP = b"<x:xmpmeta><rdf:Description tiff:Orientation=\"%d\"/></x:xmpmeta>"


def luma(data):
    """Luma as Pillow reads it: that of JPEG where it stores any, Rec. 601 else; upright."""
    picture = Image.open(io.BytesIO(data))
    if picture.mode in ("I", "I;16", "I;16B"):
        return (np.asarray(picture).astype(int) >> 8).astype(np.uint8)
    turned_by = picture.getexif().get(0x0112, 1)
    if picture.format in ("JPEG", "MPO"):
        # With the size it is not scaled.
        picture.draft("L" if picture.mode == "RGB" and has_luma(data) else picture.mode, picture.size)
    pixels = picture.convert("RGB").convert("L") if picture.mode == "CMYK" else picture.convert("L")
    return np.asarray(upright(pixels, picture, turned_by))


def colors(data):
    """Red, green and blue as Pillow reads them; upright; `None` of a gray picture."""
    picture = Image.open(io.BytesIO(data))
    if picture.mode in ("1", "L", "LA", "I", "I;16", "I;16B"):
        return None
    turned_by = picture.getexif().get(0x0112, 1)
    return np.asarray(upright(picture.convert("RGB"), picture, turned_by))


def upright(pixels, picture, turned_by):
    # Asking before reading: PNG tells EXIF behind its pixels only afterwards.
    turned_by = picture.getexif().get(0x0112, turned_by)
    ways = {
        2: Image.Transpose.FLIP_LEFT_RIGHT,
        3: Image.Transpose.ROTATE_180,
        4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE,
        6: Image.Transpose.ROTATE_270,
        7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_90,
    }
    return pixels.transpose(ways[turned_by]) if turned_by in ways else pixels


def has_luma(data):
    """Whether a JPEG of three components stores luma and not RGB."""
    has_rgb_ids = b"\3R\x11\0G\x11\0B\x11\0" in data and JFIF not in data
    return ADOBE + b"\0" not in data and not has_rgb_ids


def exif(orientation, order, kind):
    """EXIF with another tag before the orientation, and the directory apart from the head."""
    value = struct.pack(order + ("I" if kind == 4 else "HH"), *([orientation] if kind == 4 else [orientation, 0]))
    entries = struct.pack(order + "HHI", 0x010F, 2, 4) + b"abc\0"
    entries += struct.pack(order + "HHI", 0x0112, kind, 1) + value
    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 12) + bytes(4)
    return head + struct.pack(order + "H", 2) + entries + bytes(4)


def samplings():
    sides = range(1, 5)
    for (across, down), (chroma_across, chroma_down) in itertools.product(
        itertools.product(sides, sides), itertools.product(sides, sides)
    ):
        factors = [(across, down), (chroma_across, chroma_down), (chroma_across, chroma_down)]
        yield factors


def own_jpegs():
    """Layouts that Pillow does not write."""
    for idx, factors in enumerate(samplings()):
        name = "-".join(f"{across}{down}" for across, down in factors[:2])
        for interleaved in (True, False):
            size = [(37, 21), (64, 48), (5, 9), (1, 1)][idx % 4]
            layout = Layout(factors, interleaved, restart_interval=[0, 3][idx % 2], seed=idx)
            yield f"sampling-{name}-{'one' if interleaved else 'three'}", encode(*size, layout)
    usual = [[(1, 1)] * 3, [(2, 1), (1, 1), (1, 1)], [(2, 2), (1, 1), (1, 1)], [(1, 2), (1, 1), (1, 1)],
             [(4, 1), (1, 1), (1, 1)], [(1, 1), (2, 2), (2, 2)], [(1, 1), (2, 1), (2, 1)], [(1, 1), (1, 2), (1, 2)],
             [(2, 2), (2, 1), (1, 2)], [(1, 1)]]  # fmt: skip
    sizes = [(1, 1), (2, 2), (3, 1), (1, 3), (7, 9), (8, 8), (9, 7), (16, 16), (17, 15), (33, 31)]
    for idx, (factors, (width, height)) in enumerate(itertools.product(usual, sizes)):
        for interval, interleaved in itertools.product((0, 1, 2), (True, False)):
            layout = Layout(factors, interleaved, interval, seed=idx)
            yield f"size-{idx}-{interval}-{int(interleaved)}", encode(width, height, layout)
    for idx, (across, down) in enumerate(itertools.product(range(1, 5), range(1, 5))):
        yield f"gray-{across}{down}", encode(29, 18, Layout([(across, down)], seed=idx))
    for transform, interleaved in itertools.product((0, 2), (True, False)):
        adobe = [marker(0xEE, ADOBE + bytes([transform]))]
        for name, factors in (("full", [(1, 1)] * 4), ("half", [(2, 2), (1, 1), (1, 1), (2, 2)])):
            layout = Layout(factors, interleaved, segments=adobe, seed=transform)
            yield f"cmyk-{transform}-{name}-{int(interleaved)}", encode(35, 22, layout)
    yield "cmyk-plain", encode(35, 22, Layout([(1, 1)] * 4))
    rgb = [(1, 1)] * 3
    yield "rgb-ids", encode(35, 22, Layout(rgb, ids=b"RGB"))
    yield "rgb-ids-jfif", encode(35, 22, Layout(rgb, ids=b"RGB", segments=[JFIF]))
    yield "rgb-adobe", encode(35, 22, Layout(rgb, segments=[marker(0xEE, ADOBE + b"\0")]))
    yield "ycc-adobe", encode(35, 22, Layout(rgb, segments=[marker(0xEE, ADOBE + b"\1")]))
    yield "ids-from-0", encode(35, 22, Layout(rgb, ids=b"\0\1\2"))
    yield "no-tables", encode(35, 22, Layout(rgb, has_tables=False))
    yield "no-tables-jfif", encode(35, 22, Layout(rgb, has_tables=False, segments=[JFIF]))
    yield "fill-bytes", encode(35, 22, Layout(rgb, restart_interval=2, padding=b"\xff\xff"))
    for step in (1, 255, 300, 2000):
        yield f"step-{step}", encode(35, 22, Layout(rgb, step=step, wide_steps=True))
    plain = encode(35, 22, Layout(rgb))
    yield "bytes-after-the-end", plain + b"more" * 100
    yield "two-pictures", plain + encode(20, 20, Layout(rgb))
    for orientation, order, kind in itertools.product(range(1, 9), "<>", (3, 4)):
        head = marker(0xE1, b"Exif\0\0" + exif(orientation, order, kind))
        name = f"exif-{orientation}-{'little' if order == '<' else 'big'}-{kind}"
        comment = marker(0xFE, b"comment")
        for place, segments in (("first", [head, JFIF]), ("later", [JFIF, comment, marker(0xE2, b"ICC"), head])):
            yield f"{name}-{place}", encode(19, 13, Layout(rgb, segments=segments))
    for orientation in range(1, 9):
        head = marker(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + XMP % orientation)
        yield f"xmp-{orientation}", encode(19, 13, Layout(rgb, segments=[head]))
        both = [head, marker(0xE1, b"Exif\0\0" + exif(6, "<", 3))]
        yield f"xmp-{orientation}-exif", encode(19, 13, Layout(rgb, segments=both))


def drawn(width, height, mode, seed=0):
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    planes = [128 + 80 * np.sin(x / (4 + k) + k + seed) * np.cos(y / (5 - k / 2)) for k in range(4)]
    pixels = np.clip(np.stack(planes, -1) + random.normal(0, 10, (height, width, 4)), 0, 255).astype(np.uint8)
    whole = Image.fromarray(pixels, "RGBA")
    if mode == "CMYK":
        return Image.frombytes("CMYK", whole.size, whole.tobytes())
    return whole if mode == "RGBA" else whole.convert("RGB").convert(mode)


def saved(picture, kind, **options):
    data = io.BytesIO()
    picture.save(data, kind, **options)
    return data.getvalue()


def pillow_jpegs():
    sizes = [(width, height) for width in range(1, 18) for height in (1, 2, 7, 8, 9, 16, 17)] + [(160, 120), (33, 65)]
    for idx, (width, height) in enumerate(sizes):
        for progressive, subsampling in itertools.product((False, True), (0, 1, 2)):
            options = {"quality": [30, 75, 95, 100][idx % 4], "progressive": progressive, "subsampling": subsampling}
            name = f"pillow-{width}x{height}-{int(progressive)}{subsampling}"
            yield name, saved(drawn(width, height, "RGB", idx), "JPEG", **options)
    for mode, progressive in itertools.product(("L", "CMYK"), (False, True)):
        for idx, (width, height) in enumerate(sizes[::9]):
            name = f"pillow-{mode}-{width}x{height}-{int(progressive)}"
            yield name, saved(drawn(width, height, mode, idx), "JPEG", quality=90, progressive=progressive)
    for interval in (1, 2, 5):
        options = {"restart_marker_blocks": interval, "optimize": True}
        for progressive in (False, True):
            yield f"pillow-restart-{interval}-{int(progressive)}", saved(
                drawn(90, 50, "RGB"), "JPEG", progressive=progressive, **options
            )


def chunk(kind, content):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(width, height, depth, color, chunks=(), trailing=(), interlaced=False, seed=0):
    """A PNG of any depth and color type, whose samples are noise."""
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    random = np.random.default_rng(seed)

    def rows(columns, lines):
        if columns == 0 or lines == 0:
            return b""
        n_bytes = (columns * channels * depth + 7) // 8
        lines_of_bytes = (random.integers(0, 256, n_bytes, dtype=np.uint8).tobytes() for _ in range(lines))
        return b"".join(bytes([line % 2]) + content for line, content in enumerate(lines_of_bytes))

    if interlaced:
        passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
        data = b"".join(rows(len(range(x, width, dx)), len(range(y, height, dy))) for x, y, dx, dy in passes)
    else:
        data = rows(width, height)
    packed = zlib.compress(data)
    half = len(packed) // 2
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, int(interlaced)))
    palette = [chunk(b"PLTE", random.integers(0, 256, 3 << depth, dtype=np.uint8).tobytes())] if color == 3 else []
    pixels = [chunk(b"IDAT", packed[:half]), chunk(b"IDAT", packed[half:])]
    return b"\x89PNG\r\n\x1a\n" + b"".join([head, *palette, *chunks, *pixels, *trailing, chunk(b"IEND", b"")])


def pngs():
    kinds = [(0, 1), (0, 2), (0, 4), (0, 8), (0, 16), (2, 8), (2, 16), (3, 1), (3, 2), (3, 4), (3, 8), (4, 8), (4, 16),
             (6, 8), (6, 16)]  # fmt: skip
    sizes = [(1, 1), (5, 3), (9, 17), (32, 20)]
    for (color, depth), (width, height), interlaced in itertools.product(kinds, sizes, (False, True)):
        name = f"png-{color}-{depth}-{width}x{height}-{int(interlaced)}"
        yield name, png(width, height, depth, color, interlaced=interlaced, seed=depth + width)
        see_through = {0: b"\0\1", 2: b"\0\1\0\2\0\3", 3: b"\0\x80"}.get(color)
        if see_through:
            chunks = [chunk(b"tRNS", see_through)]
            yield f"{name}-trns", png(width, height, depth, color, chunks, interlaced=interlaced, seed=depth)
    profile = chunk(b"iCCP", b"x\0\0" + zlib.compress(bytes(100)))
    text = chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(100)))
    yield "png-texts", png(20, 10, 8, 2, [profile, text, chunk(b"gAMA", struct.pack(">I", 45455))], [text])
    for orientation, order, kind in itertools.product(range(1, 9), "<>", (3, 4)):
        head = chunk(b"eXIf", exif(orientation, order, kind))
        name = f"png-exif-{orientation}-{'little' if order == '<' else 'big'}-{kind}"
        yield f"{name}-before", png(19, 13, 8, 2, [head])
        yield f"{name}-after", png(19, 13, 8, 2, trailing=[head])
    xmp = chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + XMP % 6)
    yield "png-xmp", png(19, 13, 8, 2, [xmp])


def riff(chunks):
    content = b"WEBP" + b"".join(k + struct.pack("<I", len(c)) + c + b"\0" * (len(c) % 2) for k, c in chunks)
    return b"RIFF" + struct.pack("<I", len(content)) + content


def webps():
    for idx, (width, height) in enumerate([(1, 1), (2, 3), (16, 16), (17, 15), (64, 48), (75, 33)]):
        for mode, lossless in itertools.product(("RGB", "RGBA", "L"), (False, True)):
            for quality in (20, 90):
                name = f"webp-{mode}-{width}x{height}-{int(lossless)}-{quality}"
                yield name, saved(drawn(width, height, mode, idx), "WEBP", lossless=lossless, quality=quality)
    frames = [drawn(40, 30, "RGB", seed) for seed in range(3)]
    yield "webp-animated", saved(frames[0], "WEBP", save_all=True, append_images=frames[1:], lossless=True)
    plain = saved(drawn(19, 13, "RGB"), "WEBP", lossless=True)
    pixels = (plain[12:16], plain[20 : 20 + struct.unpack("<I", plain[16:20])[0]])
    for orientation, order, kind in itertools.product(range(1, 9), "<>", (3, 4)):
        head = (b"VP8X", struct.pack("<I", 8) + (18).to_bytes(3, "little") + (12).to_bytes(3, "little"))
        for name, prefix in (("plain", b""), ("prefix", b"Exif\0\0")):
            content = prefix + exif(orientation, order, kind)
            name = f"webp-exif-{orientation}-{'little' if order == '<' else 'big'}-{kind}-{name}"
            yield name, riff([head, pixels, (b"EXIF", content)])


def others():
    for width, height in [(1, 1), (3, 5), (31, 17), (64, 40)]:
        for mode in ("1", "L", "P", "RGB", "RGBA"):
            yield f"bmp-{mode}-{width}x{height}", saved(drawn(width, height, mode), "BMP")
        for mode in ("1", "L", "RGB"):
            yield f"pnm-{mode}-{width}x{height}", saved(drawn(width, height, mode), "PPM")
        numbers = np.random.default_rng(width).integers(0, 256, (height, width, 3))
        flat = " ".join(map(str, numbers.ravel() % 2))
        size = f"{width} {height}"
        yield f"pnm-p1-{width}", f"P1 {size}\n# a comment\n{' '.join(map(str, numbers[:, :, 0].ravel() % 2))}\n".encode()
        yield f"pnm-p2-{width}", f"P2\n{size}\n255\n{' '.join(map(str, numbers[:, :, 0].ravel()))}\n".encode()
        yield f"pnm-p3-{width}", f"P3 {size} 255\n{' '.join(map(str, numbers.ravel()))}\n".encode()
        yield f"pnm-p3-two-{width}", f"P3 {size} 1\n{flat}\n".encode()
        for most in (1, 7, 100):
            levels = (numbers[:, :, 0] % (most + 1)).astype(np.uint8).tobytes()
            yield f"pnm-p5-{most}-{width}", f"P5\n#c\n{size} {most}\n".encode() + levels
        wide = np.random.default_rng(width).integers(0, 65536, (height, width), dtype=np.uint16)
        yield f"pnm-p5-wide-{width}", f"P5 {size} 65535\n".encode() + wide.astype(">u2").tobytes()
        yield f"pnm-p5-4095-{width}", f"P5 {size} 4095\n".encode() + (wide >> 4).astype(">u2").tobytes()


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    n_written, left_out = 0, []
    kinds = {"jpg": (own_jpegs, pillow_jpegs), "png": (pngs,), "webp": (webps,), "pic": (others,)}
    for extension, generators in kinds.items():
        for name, data in itertools.chain.from_iterable(generator() for generator in generators):
            try:
                pixels, colored = luma(data), colors(data)
            except (OSError, SyntaxError, ValueError) as error:
                left_out.append(f"{name}: {error}")
                continue
            path = folder / f"{name}.{extension}"
            path.write_bytes(data)
            height, width = pixels.shape
            content = struct.pack("<II", width, height) + pixels.tobytes()
            path.with_name(path.name + ".luma").write_bytes(content + (b"" if colored is None else colored.tobytes()))
            n_written += 1
    print(f"{n_written} pictures; Pillow does not read {len(left_out)} more")
    return left_out


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    left_out = main(pathlib.Path(sys.argv[1]))
    if "--left-out" in sys.argv:
        print("\n".join(left_out))
