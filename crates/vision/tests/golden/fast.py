#!/usr/bin/env python3
"""Makes the golden FAST-9 corners: pieces of frames of the simulated lab, and what OpenCV finds in them.

    roomsight simulate LAB --illumination cloudy1,night1 --frames-per-second 0.02
    python3 crates/vision/tests/golden/fast.py LAB

Needs opencv-python-headless. Writes beside this file NAME.png, 8-bit luma, and NAME.txt, a line
`threshold x y response` for each corner.
"""
import sys
from pathlib import Path

import cv2

THRESHOLDS = [10, 20, 40]
# Name: sequence, camera, which frame, and the piece of it (left, top, width, height). Odd widths leave
# pixels over after the vectors of any instruction set.
PIECES = {
    "perspective_cloudy": ("seq3_cloudy1", "std_cam", 1, (160, 120, 320, 240)),
    "perspective_night": ("seq3_night1", "std_cam", 2, (200, 100, 237, 181)),
    "omnidirectional_cloudy": ("seq3_cloudy1", "omni_cam", 1, (140, 20, 345, 220)),
}


def corners(image, threshold):
    fast = cv2.FastFeatureDetector_create(threshold, True, cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)
    found = [(int(k.pt[1]), int(k.pt[0]), int(k.response)) for k in fast.detect(image)]
    return [f"{threshold} {x} {y} {response}" for y, x, response in sorted(found)]


here = Path(__file__).parent
for name, (sequence, camera, frame_idx, (left, top, width, height)) in PIECES.items():
    folder = Path(sys.argv[1], "cold-saarbruecken", "part_b", sequence, camera)
    frame = cv2.imread(str(sorted(folder.glob("*.jpeg"))[frame_idx]), cv2.IMREAD_GRAYSCALE)
    image = frame[top : top + height, left : left + width].copy()
    cv2.imwrite(str(here / f"{name}.png"), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    lines = [f"# threshold x y response, as OpenCV {cv2.__version__} finds them; made by fast.py"]
    for threshold in THRESHOLDS:
        lines += corners(image, threshold)
    (here / f"{name}.txt").write_text("\n".join(lines) + "\n")
    print(name, len(lines) - 1, "corners")
