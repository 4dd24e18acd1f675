#!/usr/bin/env python3
"""Makes the golden SIFT keypoints: what OpenCV finds in the golden frames that fast.py cut out.

    python3 crates/vision/tests/golden/sift.py

Needs opencv-python-headless. Writes beside this file NAME_sift.txt, a line
`x y response scale angle descriptor` for each of the stronger half of the keypoints: angles in degrees,
descriptors as 128 whole numbers.
"""
from pathlib import Path

import cv2

# Its other way to double an image moves every keypoint by a quarter of a pixel.
SIFT = cv2.SIFT_create(enable_precise_upscale=True)


def line(keypoint, descriptor):
    (x, y), scale = keypoint.pt, keypoint.size / 2
    numbers = " ".join(str(int(number)) for number in descriptor)
    return f"{x:.3f} {y:.3f} {keypoint.response:.6g} {scale:.4f} {keypoint.angle:.2f} {numbers}"


for picture in sorted(Path(__file__).parent.glob("*.png")):
    image = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    found = sorted(SIFT.detect(image), key=lambda found: (-found.response, found.pt, found.angle))
    keypoints, descriptors = SIFT.compute(image, found[: (len(found) + 1) // 2])
    lines = [f"# x y response scale angle descriptor, as OpenCV {cv2.__version__} finds them; made by sift.py"]
    lines += [line(keypoint, descriptor) for keypoint, descriptor in zip(keypoints, descriptors)]
    picture.with_name(f"{picture.stem}_sift.txt").write_text("\n".join(lines) + "\n")
    print(picture.stem, len(keypoints), "keypoints")
