#!/usr/bin/env python3
"""Trains small problems with LIBSVM and writes its model files, the rows, and the decision values.

    python3 crates/recognition/tests/golden/libsvm_models.py

Needs libsvm-official and numpy. Writes beside this file libsvm_KERNEL.model, as LIBSVM saves it, and
libsvm_KERNEL.json, the rows and what LIBSVM says of them.
"""

import importlib.metadata
import json
from pathlib import Path

import numpy as np
from libsvm.svmutil import svm_predict, svm_save_model, svm_train

FOLDER = Path(__file__).parent
# The sigmoid is no Mercer kernel, but with these parameters so nearly one that there is a single optimum.
OPTIONS = {
    "linear": "-t 0 -c 5",
    "rbf": "-t 2 -c 10 -g 0.7 -b 1",
    "sigmoid": "-t 3 -c 20 -g 0.02 -r -1",
}

random = np.random.default_rng(7)
centers = random.normal(size=(4, 6))
labels = np.arange(48) % 4
rows = (centers[labels] + random.normal(size=(48, 6))).round(3)
rows[random.random(rows.shape) < 0.2] = 0.0
names = [3, 1, 12, -5]
targets = [names[label] for label in labels]

for kernel, options in OPTIONS.items():
    path = FOLDER / f"libsvm_{kernel}.model"
    model = svm_train(targets, rows.tolist(), f"{options} -e 1e-6 -q")
    svm_save_model(str(path), model)
    _, _, decision_values = svm_predict(targets, rows.tolist(), model, "-q")
    golden = {
        "libsvm": importlib.metadata.version("libsvm-official"),
        "options": options,
        "rows": rows.tolist(),
        "labels": targets,
        "decision_values": decision_values,
    }
    if "-b 1" in options:
        _, _, golden["probabilities"] = svm_predict(targets, rows.tolist(), model, "-b 1 -q")
    path.with_suffix(".json").write_text(json.dumps(golden) + "\n")
