#!/usr/bin/env python3
"""Makes the golden LBP and CS-LBP histograms: what scikit-image computes on the golden frames.

    python3 crates/vision/tests/golden/skimage_lbp.py

Needs scikit-image. Writes skimage_lbp.json beside this file: histograms of square regions round places of
the frames, cell by cell, as counts of pixels. LBP codes are those of local_binary_pattern ("default" and
"nri_uniform"). scikit-image has no CS-LBP: its codes are computed here, by the paper's equation, from
neighbors that skimage.transform.warp interpolates.

A pixel is undecided where a comparison is closer than weights rounded to 1/256 can tell (three of a
neighbor's four weights are off by up to 1/512, the fourth by what remains), or where floating point makes a
tie fall either way, as in flat parts of a frame. The places are those with the fewest such pixels.
"""
import json
from pathlib import Path

import numpy as np
import skimage
from skimage.feature import local_binary_pattern
from skimage.transform import warp

FRAMES = ["perspective_cloudy", "perspective_night", "omnidirectional_cloudy"]
REGION_SIDE = 32
N_PLACES = 6
LBP = [{"radius": 1.0, "n_cells": 2}, {"radius": 2.5, "n_cells": 3}]
CS_LBP = [
    {"radius": 2.0, "n_cells": 3, "n_neighbors": 6, "threshold": 0.01},
    {"radius": 1.5, "n_cells": 4, "n_neighbors": 8, "threshold": 0.02},
]
# What floating point leaves of equal gray values, and of a threshold rounded to 1/256.
ROUNDING = 1e-9
THRESHOLD_ROUNDING = 1 / 512
WEIGHT_ROUNDING = 3 / 512


def circle(n_neighbors, radius):
    """As scikit-image rounds it: columns, rows."""
    angles = 2 * np.pi * np.arange(n_neighbors) / n_neighbors
    return np.round(radius * np.cos(angles), 5), np.round(-radius * np.sin(angles), 5)


def neighbor(image, column, row):
    """The neighbor of each pixel, and by how much rounded weights may move it."""
    rows, columns = np.indices(image.shape, dtype=float)
    rows, columns = rows + row, columns + column
    values = warp(image.astype(float), np.array([rows, columns]), order=1, mode="edge", preserve_range=True)
    tops, lefts = np.floor(rows).astype(int), np.floor(columns).astype(int)
    corners = [
        image[np.clip(tops + down, 0, image.shape[0] - 1), np.clip(lefts + right, 0, image.shape[1] - 1)]
        for down in (0, 1)
        for right in (0, 1)
    ]
    is_on_grid = float(column).is_integer() and float(row).is_integer()
    spread = np.ptp(np.array(corners, dtype=float), axis=0)
    return values, np.zeros(image.shape) if is_on_grid else WEIGHT_ROUNDING * spread


def lbp_maps(image, radius):
    codes = local_binary_pattern(image, 8, radius, "default").astype(int)
    labels = local_binary_pattern(image, 8, radius, "nri_uniform").astype(int)
    undecided = np.zeros(image.shape, dtype=bool)
    for column, row in zip(*circle(8, radius)):
        values, error = neighbor(image, column, row)
        is_on_grid = float(column).is_integer() and float(row).is_integer()
        undecided |= (np.abs(values - image) <= error + ROUNDING) & (not is_on_grid)
    return codes, labels, undecided


def cs_lbp_maps(image, radius, n_neighbors, threshold):
    neighbors = [neighbor(image, *place) for place in zip(*circle(n_neighbors, radius))]
    codes = np.zeros(image.shape, dtype=int)
    undecided = np.zeros(image.shape, dtype=bool)
    for bit, ((a, a_error), (b, b_error)) in enumerate(zip(neighbors, neighbors[n_neighbors // 2 :])):
        excess = a - b - threshold * 255
        codes |= (excess > 0).astype(int) << bit
        undecided |= np.abs(excess) <= a_error + b_error + THRESHOLD_ROUNDING
    return codes, undecided


def cells(values, place, n_cells):
    """The values in each cell of the region round a place."""
    left, top = place[0] - REGION_SIDE // 2, place[1] - REGION_SIDE // 2
    region = values[top : top + REGION_SIDE, left : left + REGION_SIDE]
    cell_of = np.arange(REGION_SIDE) * n_cells // REGION_SIDE
    return [region[np.ix_(cell_of == y, cell_of == x)] for y in range(n_cells) for x in range(n_cells)]


def decided_places(image):
    """Places of a grid, no two regions over each other."""
    margin = REGION_SIDE // 2 + 4
    columns = range(margin, image.shape[1] - margin, REGION_SIDE)
    rows = range(margin, image.shape[0] - margin, REGION_SIDE)
    undecided = lbp_maps(image, 1.0)[2]
    grid = [(x, y) for y in rows for x in columns]
    return sorted(grid, key=lambda place: cells(undecided, place, 1)[0].sum())[:N_PLACES]


def described(codes, n_bins, undecided, n_cells, places):
    return [
        {
            "x": place[0],
            "y": place[1],
            "cells": [np.bincount(c.ravel(), minlength=n_bins).tolist() for c in cells(codes, place, n_cells)],
            "n_undecided": [int(c.sum()) for c in cells(undecided, place, n_cells)],
        }
        for place in places
    ]


here = Path(__file__).parent
images = {name: skimage.io.imread(here / f"{name}.png") for name in FRAMES}
label_of = {}
cases = []
for name, image in images.items():
    places = decided_places(image)
    for parameters in LBP:
        codes, labels, undecided = lbp_maps(image, parameters["radius"])
        label_of |= dict(zip(codes.ravel().tolist(), labels.ravel().tolist()))
        regions = described(labels, 59, undecided, parameters["n_cells"], places)
        cases.append({"kind": "lbp", "frame": name, "parameters": parameters, "regions": regions})
    for parameters in CS_LBP:
        n_bins = 1 << parameters["n_neighbors"] // 2
        codes, undecided = cs_lbp_maps(image, *(parameters[k] for k in ("radius", "n_neighbors", "threshold")))
        regions = described(codes, n_bins, undecided, parameters["n_cells"], places)
        cases.append({"kind": "cs_lbp", "frame": name, "parameters": parameters, "regions": regions})
uniform = [label_of[code] for code in sorted(label_of) if label_of[code] != 58]
assert sorted(uniform) == list(range(58)), "a uniform pattern does not occur"
golden = {
    "made_by": f"skimage_lbp.py with scikit-image {skimage.__version__}",
    "region_side": REGION_SIDE,
    "uniform_labels_by_code": uniform,
    "cases": cases,
}
(here / "skimage_lbp.json").write_text(json.dumps(golden, separators=(",", ":")) + "\n")
for case in cases:
    n_pixels = N_PLACES * REGION_SIDE**2
    n_undecided = sum(sum(region["n_undecided"]) for region in case["regions"])
    print(case["frame"], case["kind"], case["parameters"], f"{n_undecided / n_pixels:.2%} undecided")
