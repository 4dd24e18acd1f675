#!/usr/bin/env python3
"""Makes the golden keypoints of XFeat: what the authors' steps, in numpy, make of the network's maps.

    python3 crates/vision/tests/golden/xfeat.py xfeat_640x352.onnx

Needs numpy, onnxruntime and OpenCV. Writes xfeat.json beside this file: a window of the maps that the network makes of
the frame perspective_cloudy, in whole numbers (times 512), and what is found in that window.
The steps are those of modules/xfeat.py of https://github.com/verlab/accelerated_features; descriptors and reliability
are interpolated linearly, and beyond the border it is repeated.
"""
import json
import sys
from pathlib import Path

import cv2
import numpy as np
import onnxruntime

ONE = 512
LEFT, TOP, N_COLUMNS, N_ROWS = 34, 14, 9, 6
FOLDER = Path(__file__).parent


def heatmap(scores):
    powers = np.exp(scores - scores.max(0))
    shares = (powers / powers.sum(0))[:64]
    _, rows, columns = shares.shape
    cells = shares.transpose(1, 2, 0).reshape(rows, columns, 8, 8)
    return cells.transpose(0, 2, 1, 3).reshape(rows * 8, columns * 8)


def peaks(heat):
    padded = np.pad(heat, 2, constant_values=-np.inf)
    height, width = heat.shape
    around = [padded[y : y + height, x : x + width] for y in range(5) for x in range(5)]
    return np.argwhere((heat == np.max(around, 0)) & (heat > 0.05))


def sampled(plane, x, y, width, height):
    """torch.nn.functional.grid_sample of C x H x W, bilinear, align_corners=False, padding_mode="border"."""
    _, rows, columns = plane.shape
    grid_x, grid_y = 2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1
    column = np.clip(((grid_x + 1) * columns - 1) / 2, 0, columns - 1)
    row = np.clip(((grid_y + 1) * rows - 1) / 2, 0, rows - 1)
    left, top = int(column), int(row)
    right, bottom = min(left + 1, columns - 1), min(top + 1, rows - 1)
    across, down = column - left, row - top
    upper = plane[:, top, left] * (1 - across) + plane[:, top, right] * across
    lower = plane[:, bottom, left] * (1 - across) + plane[:, bottom, right] * across
    return upper * (1 - down) + lower * down


def main(network):
    frame = cv2.resize(cv2.imread(str(FOLDER / "perspective_cloudy.png")), (640, 352), interpolation=cv2.INTER_AREA)
    picture = frame[:, :, ::-1].transpose(2, 0, 1)[None].astype(np.float32)
    session = onnxruntime.InferenceSession(network)
    window = np.s_[0, :, TOP : TOP + N_ROWS, LEFT : LEFT + N_COLUMNS]
    maps = [output[window] for output in session.run(["feats", "keypoints", "reliability"], {"image": picture})]
    whole = [np.round(plane * ONE).astype(int) for plane in maps]
    features, scores, reliability = (plane.astype(float) / ONE for plane in whole)
    features = features / np.linalg.norm(features, axis=0)
    heat = heatmap(scores)
    height, width = heat.shape
    found = []
    for y, x in peaks(heat):
        response = heat[y, x] * sampled(reliability, x, y, width, height)[0]
        descriptor = sampled(features, x, y, width, height)
        descriptor /= np.linalg.norm(descriptor)
        found.append(
            {"x": int(x), "y": int(y), "response": round(response, 6), "descriptor": np.round(descriptor, 4).tolist()}
        )
    golden = {"n_columns": N_COLUMNS, "n_rows": N_ROWS, "one": ONE}
    golden |= dict(zip(("features", "keypoints", "reliability"), (plane.ravel().tolist() for plane in whole)))
    golden["found"] = found
    (FOLDER / "xfeat.json").write_text(json.dumps(golden, separators=(",", ":")) + "\n")
    print(len(found), "keypoints", sorted((f["response"] for f in found), reverse=True))


if __name__ == "__main__":
    main(sys.argv[1])
