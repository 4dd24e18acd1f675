"""Writes recordings of every kind into a folder, by the libraries of others, and beside each what is in it.

    matrix.py FOLDER

A recording is a file or a folder; `NAME.json` beside it says which messages it holds: their topics, types, times, and of
pictures the file or the pixels that they show, of poses where they are, of scans the ranges, of texts what they say. Needs rosbags, mcap,
foxglove-schemas-protobuf and numpy.
"""

import base64
import json
import shutil
import sys
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage as FoxgloveCompressed
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage as FoxgloveRaw
from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Bag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_700_000_000_000_000_000
N_FRAMES = 12
WIDTH, HEIGHT = 8, 6
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
# Not among the messages of that distribution.
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))


def jpeg(number: int) -> bytes:
    """Bytes that stand for a file of a camera: no picture is decoded here."""
    return b"\xff\xd8" + bytes([number]) * 200 + b"\xff\xd9"


def rgb(number: int) -> np.ndarray:
    rows, columns, channels = np.indices((HEIGHT, WIDTH, 3))
    return ((rows * 31 + columns * 7 + channels * 50 + number * 3) % 256).astype(np.uint8)


def raw(encoding: str, number: int, padding: int, big_endian: bool = False):
    """The bytes and the step of pixels in an encoding, and the netpbm file that shows the same."""
    picture = rgb(number)
    gray = picture[:, :, 1]
    wide = picture.astype(np.uint16) * 257
    order = ">u2" if big_endian else "<u2"

    def padded(rows: np.ndarray) -> tuple[bytes, int]:
        rows = rows.reshape(HEIGHT, -1).view(np.uint8)
        rows = np.hstack([rows, np.full((HEIGHT, padding), 99, np.uint8)])
        return rows.tobytes(), rows.shape[1]

    def pnm(pixels: np.ndarray) -> bytes:
        kind, largest = (5 if pixels.ndim == 2 else 6), (65535 if pixels.dtype == np.uint16 else 255)
        head = f"P{kind}\n{WIDTH} {HEIGHT}\n{largest}\n".encode()
        return head + pixels.astype(">u2" if largest > 255 else np.uint8).tobytes()

    alpha = np.dstack([picture, np.full((HEIGHT, WIDTH), 7, np.uint8)])
    known = {
        "mono8": (gray, gray),
        "8UC1": (gray, gray),
        "rgb8": (picture, picture),
        "bgr8": (picture[:, :, ::-1], picture),
        "rgba8": (alpha, picture),
        "bgra8": (alpha[:, :, [2, 1, 0, 3]], picture),
        "mono16": (wide[:, :, 1].astype(order), wide[:, :, 1]),
        "rgb16": (wide.astype(order), wide),
        "bgr16": (wide[:, :, ::-1].astype(order), wide),
    }
    if encoding in known:
        pixels, shown = known[encoding]
        return (*padded(np.ascontiguousarray(pixels)), pnm(shown))
    if encoding.startswith("bayer_"):
        # One color all over: what is between the pixels of a sensor is each reader's own.
        color = picture[0, 0]
        tile = np.array(["rgb".index(letter) for letter in encoding[6:10]]).reshape(2, 2)
        sensor = color[np.tile(tile, (HEIGHT // 2, WIDTH // 2))]
        shown = np.broadcast_to(color, (HEIGHT, WIDTH, 3))
        if encoding.endswith("16"):
            return (*padded((sensor.astype(np.uint16) * 257).astype(order)), pnm(shown.astype(np.uint16) * 257))
        return (*padded(sensor), pnm(shown))
    # Gray video: luma with no color in it.
    luma = (gray // 2 + 16).astype(np.uint8)
    none = np.full_like(luma, 128)
    pairs = np.dstack([none, luma] if encoding in ("yuv422", "uyvy") else [luma, none])
    shown = np.clip(np.round(np.float32(1.164) * (luma.astype(np.float32) - 16)), 0, 255).astype(np.uint8)
    return (*padded(pairs), pnm(np.dstack([shown] * 3)))


ENCODINGS = [
    "mono8", "8UC1", "rgb8", "bgr8", "rgba8", "bgra8", "mono16", "rgb16", "bgr16", "yuv422", "yuv422_yuy2",
    "bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8", "bayer_rggb16",
]  # fmt: skip


def messages(store, short: bool):
    """Topic, type, time, message, and what it tells; `short` names of types are those of ROS 1."""
    types = store.types
    stamp_of = lambda ns: types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    seq = {"seq": 0} if short else {}
    header = lambda ns, frame: types["std_msgs/msg/Header"](stamp=stamp_of(ns), frame_id=frame, **seq)
    point = lambda x, y: types["geometry_msgs/msg/Point"](x=x, y=y, z=0.3)
    turned = lambda yaw: types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))
    pose = lambda x, y, yaw: types["geometry_msgs/msg/Pose"](position=point(x, y), orientation=turned(yaw))
    covered = lambda pose: types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))
    nothing = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    for number in range(N_FRAMES):
        ns = START_NS + number * 100_000_000
        x, y, yaw = number * 0.5, -number * 0.25, number * 0.2
        at = {"x": x, "y": y, "yaw": yaw}
        image = types["sensor_msgs/msg/CompressedImage"](
            header=header(ns - 5_000_000, "camera"), format="jpeg", data=np.frombuffer(jpeg(number), np.uint8)
        )
        yield "/camera/compressed", image, ns, {
            "stamp": ns - 5_000_000, "picture": base64.b64encode(jpeg(number)).decode()
        }  # fmt: skip
        for encoding in ENCODINGS:
            big_endian = "16" in encoding and number % 2 == 1
            data, step, shown = raw(encoding, number, padding=number % 3, big_endian=big_endian)
            image = types["sensor_msgs/msg/Image"](
                header=header(ns, "camera"), height=HEIGHT, width=WIDTH, encoding=encoding,
                is_bigendian=int(big_endian), step=step, data=np.frombuffer(data, np.uint8),
            )  # fmt: skip
            yield f"/raw/{encoding}", image, ns + 1, {"stamp": ns, "picture": base64.b64encode(shown).decode()}
        odometry = types["nav_msgs/msg/Odometry"](
            header=header(ns, "odom"), child_frame_id="base_link", pose=covered(pose(x, y, yaw)),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](
                twist=types["geometry_msgs/msg/Twist"](linear=nothing, angular=nothing), covariance=np.zeros(36)
            ),
        )  # fmt: skip
        yield "/odom", odometry, ns + 2, {"stamp": ns, "poses": [{"frame": "odom", "child": "base_link", **at}]}
        stamped = types["geometry_msgs/msg/PoseStamped"](header=header(ns, "map"), pose=pose(x, y, yaw))
        yield "/pose", stamped, ns + 3, {"stamp": ns, "poses": [{"frame": "map", "child": "", **at}]}
        sure = types["geometry_msgs/msg/PoseWithCovarianceStamped"](
            header=header(ns, "map"), pose=covered(pose(x, y, yaw))
        )
        yield "/amcl_pose", sure, ns + 4, {"stamp": ns, "poses": [{"frame": "map", "child": "", **at}]}
        moved = lambda child: types["geometry_msgs/msg/TransformStamped"](
            header=header(ns, "map"), child_frame_id=child,
            transform=types["geometry_msgs/msg/Transform"](
                translation=types["geometry_msgs/msg/Vector3"](x=x, y=y, z=0.0), rotation=turned(yaw)
            ),
        )  # fmt: skip
        transforms = types["tf2_msgs/msg/TFMessage"](transforms=[moved("odom"), moved("laser")])
        yield "/tf", transforms, ns + 5, {
            "stamp": ns, "poses": [{"frame": "map", "child": child, **at} for child in ("odom", "laser")]
        }  # fmt: skip
        ranges = np.arange(1, 182, dtype=np.float32) / 16 + number
        scan = types["sensor_msgs/msg/LaserScan"](
            header=header(ns, "laser"), angle_min=-1.5, angle_max=1.5, angle_increment=0.0625, time_increment=0.0, scan_time=0.1,
            range_min=0.125, range_max=30.0, ranges=ranges, intensities=np.zeros(number, np.float32),
        )  # fmt: skip
        yield "/scan", scan, ns + 7, {
            "stamp": ns, "scan": {"start": -1.5, "step": 0.0625, "longest": 30.0, "ranges": ranges.tolist()}
        }  # fmt: skip
        text = types["std_msgs/msg/String"](data=f"room {number // 6}")
        yield "/room", text, ns + 6, {"text": f"room {number // 6}"}
        yield "/count", types["std_msgs/msg/Int32"](data=number), ns + 7, {}


class Expected:
    def __init__(self, path: Path) -> None:
        self.path, self.messages = path, []

    def add(self, topic: str, type_name: str, time: int, told: dict) -> None:
        self.messages.append({"topic": topic, "type": type_name, "time": time, **told})

    def write(self) -> None:
        self.path.with_name(self.path.name + ".json").write_text(json.dumps(self.messages))


def record(path: Path, writer, store, serialize, type_of=lambda type_name: type_name) -> None:
    """Writes all messages of a distribution by a writer of rosbags; ``type_of`` is what a recording calls a type."""
    expected, connections = Expected(path), {}
    with writer:
        for topic, message, time, told in messages(store, short=store is ROS1):
            type_name = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=store)
            writer.write(connections[topic], time, serialize(message, type_name))
            expected.add(topic, type_of(type_name), time, told)
    expected.write()


def rosbag2(path: Path, plugin, mode=None) -> None:
    writer = Bag2Writer(path, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    record(path, writer, ROS2, ROS2.serialize_cdr)


def rosbag1(path: Path, compression=None) -> None:
    writer = Bag1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    record(path, writer, ROS1, ROS1.serialize_ros1, lambda type_name: type_name.replace("/msg/", "/"))


def foxglove(path: Path, encoding: str, **options) -> None:
    """Pictures as Foxglove has them, straight to MCAP, in small chunks."""
    expected = Expected(path)
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=4096, **options)
        writer.start()
        channels = {}
        for topic, name in (("/compressed", "foxglove.CompressedImage"), ("/raw", "foxglove.RawImage")):
            schema_encoding = "protobuf" if encoding == "protobuf" else "jsonschema"
            schema = writer.register_schema(name=name, encoding=schema_encoding, data=b"{}")
            channels[topic] = writer.register_channel(topic=topic, message_encoding=encoding, schema_id=schema)
        for number in range(N_FRAMES):
            ns = START_NS + number * 100_000_000
            data, step, shown = raw("bgr8", number, padding=number % 3)
            fields = {
                "/compressed": {"frame_id": "camera", "data": jpeg(number), "format": "jpeg"},
                "/raw": {
                    "frame_id": "camera", "width": WIDTH, "height": HEIGHT, "encoding": "bgr8", "step": step,
                    "data": data,
                },
            }  # fmt: skip
            for topic, of_topic in fields.items():
                if encoding == "protobuf":
                    message = (FoxgloveCompressed if topic == "/compressed" else FoxgloveRaw)(**of_topic)
                    message.timestamp.FromNanoseconds(ns)
                    written = message.SerializeToString()
                else:
                    of_topic["data"] = base64.b64encode(of_topic["data"]).decode()
                    of_topic["timestamp"] = {"sec": ns // 10**9, "nsec": ns % 10**9}
                    written = json.dumps(of_topic).encode()
                writer.add_message(channels[topic], log_time=ns + 1, data=written, publish_time=ns)
                picture = jpeg(number) if topic == "/compressed" else shown
                name = "foxglove.CompressedImage" if topic == "/compressed" else "foxglove.RawImage"
                told = {"stamp": ns, "picture": base64.b64encode(picture).decode()}
                expected.add(topic, name, ns + 1, told)
        writer.finish()
    expected.write()


def main(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    rosbag2(folder / "rosbag2_sqlite", StoragePlugin.SQLITE3)
    rosbag2(folder / "rosbag2_sqlite_messages_zstd", StoragePlugin.SQLITE3, CompressionMode.MESSAGE)
    rosbag2(folder / "rosbag2_sqlite_file_zstd", StoragePlugin.SQLITE3, CompressionMode.FILE)
    rosbag2(folder / "rosbag2_mcap", StoragePlugin.MCAP)
    rosbag2(folder / "rosbag2_mcap_storage_zstd", StoragePlugin.MCAP, CompressionMode.STORAGE)
    rosbag1(folder / "ros1.bag")
    for compression in Bag1Writer.CompressionFormat:
        rosbag1(folder / f"ros1_{compression.name.lower()}.bag", compression)
    for encoding in ("protobuf", "json"):
        for compression in CompressionType:
            name = f"foxglove_{encoding}_{compression.name.lower()}.mcap"
            foxglove(folder / name, encoding, compression=compression)
        foxglove(folder / f"foxglove_{encoding}_no_chunks.mcap", encoding, use_chunking=False)
        foxglove(folder / f"foxglove_{encoding}_no_index.mcap", encoding, index_types=IndexType.NONE)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
