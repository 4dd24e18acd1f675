#!/usr/bin/env python3
"""Makes the golden Harris-Laplace keypoints: what OpenCV finds in the golden frames that fast.py cut out.

    python3 crates/vision/tests/golden/harris_laplace.py

Needs opencv-contrib-python-headless. Writes beside this file NAME_harris_laplace.txt, a line `x y response scale` for
each of the stronger half of the keypoints.
"""
from pathlib import Path

import cv2

DETECTOR = cv2.xfeatures2d.HarrisLaplaceFeatureDetector_create()


def line(keypoint):
    (x, y), scale = keypoint.pt, keypoint.size / 6
    return f"{x:.3f} {y:.3f} {keypoint.response:.6g} {scale:.4f}"


for picture in sorted(Path(__file__).parent.glob("*.png")):
    image = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    found = sorted(DETECTOR.detect(image), key=lambda found: (-found.response, found.pt, found.size))
    keypoints = found[: (len(found) + 1) // 2]
    lines = [f"# x y response scale, as OpenCV {cv2.__version__} finds them; made by harris_laplace.py"]
    lines += [line(keypoint) for keypoint in keypoints]
    picture.with_name(f"{picture.stem}_harris_laplace.txt").write_text("\n".join(lines) + "\n")
    print(picture.stem, len(keypoints), "keypoints")
