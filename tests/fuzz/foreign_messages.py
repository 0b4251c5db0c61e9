"""MCAP files of messages that we read and do not write: other types of ROS, Foxglove's JSON and protobuf; some are damaged."""

from __future__ import annotations

import io
import json
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from PIL import Image

from gridslam.core.messages import PointCloud
from gridslam.logs.ros.encode import encode
from tests.fuzz.damage import changed
from tests.fuzz.value_trees import damaged
from tests.logs import test_protobuf as protobuf
from tests.logs.ros_samples import HUMBLE, header, make

S = 10**9
Message = tuple[str, str, str, bytes, str, bytes]  # topic, type, schema's encoding, schema, encoding, data


def fuzz_foreign(path: Path, sample: Path, rng: random.Random) -> Path:
    """Three messages of each of a few kinds; one in five is damaged, and now and then a schema."""
    kinds = rng.sample(list(KINDS), rng.choice((1, 2, 3)))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        for kind in kinds:
            schema, channel = 0, 0
            for number, (topic, name, form, text, encoding, data) in enumerate(messages_of(kind)):
                if not number:
                    text = changed(text, rng) if rng.random() < 0.1 else text
                    schema = writer.register_schema(name, form, text)
                    channel = writer.register_channel(topic, encoding, schema)
                if rng.random() < 0.2:
                    data = _damaged_json(data, rng) if encoding == "json" else changed(data, rng)
                writer.add_message(channel, number + 1, data, number + 1)
        writer.finish()
    return path


def _damaged_json(data: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.2:
        return changed(data, rng)
    return json.dumps(damaged(json.loads(data), rng), default=str).encode()


@cache
def messages_of(kind: str) -> list[Message]:
    """Three messages of a kind."""
    return [message for second in range(1, 4) for message in KINDS[kind](second)]


def _ros(topic: str, message: Any) -> Message:
    name = message.__msgtype__
    text, _ = HUMBLE.generate_msgdef(name, ros_version=2)
    return topic, name, "ros2msg", text.encode(), "cdr", bytes(HUMBLE.serialize_cdr(message, name))


def _echoes(second: int) -> Iterator[Message]:
    echo = make("sensor_msgs/msg/LaserEcho", echoes=np.array([1.0, 2.0], np.float32))
    limits = {
        "angle_min": -1.0,
        "angle_max": 1.0,
        "angle_increment": 0.5,
        "range_min": 0.1,
        "range_max": 30.0,
    }
    head = header(second * S, "laser")
    yield _ros(
        "/echoes", make("sensor_msgs/msg/MultiEchoLaserScan", header=head, ranges=[echo] * 5, **limits)
    )


def _cloud(second: int) -> Iterator[Message]:
    points = np.arange(30, dtype=np.float32).reshape(10, 3)
    (found,) = encode(
        PointCloud(second * S, "lidar", points, np.linspace(0, 0.1, 10, dtype=np.float32)), "/points"
    )
    text, _ = HUMBLE.generate_msgdef(found.type, ros_version=2)
    yield "/points", found.type, "ros2msg", text.encode(), "cdr", bytes(found.data)


def _picture(second: int) -> Iterator[Message]:
    packed = io.BytesIO()
    Image.fromarray(np.full((6, 8), 40 * second, np.uint8)).save(packed, "PNG")
    fields = {"header": header(second * S, "cam"), "data": np.frombuffer(packed.getvalue(), np.uint8)}
    yield _ros(
        "/c/image/compressed",
        make("sensor_msgs/msg/CompressedImage", format="mono8; png compressed", **fields),
    )


def _depth(second: int) -> Iterator[Message]:
    fields = {"header": header(second * S, "cam"), "height": 3, "width": 4, "step": 8, "encoding": "16UC1"}
    yield _ros("/c/depth/image", make("sensor_msgs/msg/Image", data=np.full(24, 7, np.uint8), **fields))


def _pose(second: int) -> Iterator[Message]:
    message = make("geometry_msgs/msg/PoseStamped", header=header(second * S, "map"))
    message.pose.orientation.w = 1.0
    yield _ros("/ground_truth", message)


def _json(topic: str, name: str, document: dict[str, Any], second: int) -> Message:
    document = {"timestamp": {"sec": second, "nsec": 500}, **document}
    return topic, f"foxglove.{name}", "jsonschema", b"{}", "json", json.dumps(document).encode()


POSE = {"position": {"x": 1.0, "y": 2.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
SCAN = {
    "frame_id": "laser",
    "pose": POSE,
    "start_angle": -1.0,
    "end_angle": 1.0,
    "ranges": [1.0, 2.0, 3.0],
    "intensities": [],
}
PIXELS = {"frame_id": "cam", "width": 4, "height": 1, "encoding": "mono8", "step": 4, "data": "AQIDBA=="}
EDGE = {
    "parent_frame_id": "base_link",
    "child_frame_id": "laser",
    "translation": POSE["position"],
    "rotation": POSE["orientation"],
}
LENS = {
    "frame_id": "cam", "width": 4, "height": 1, "distortion_model": "plumb_bob", "D": [0.0] * 5,
    "K": [10.0, 0, 2, 0, 10, 1, 0, 0, 1],
    "R": [1.0, 0, 0, 0, 1, 0, 0, 0, 1], "P": [10.0, 0, 2, 0, 0, 10, 1, 0, 0, 0, 1, 0],
}  # fmt: skip
DOCUMENTS: dict[str, tuple[str, dict[str, Any]]] = {
    "LaserScan": ("/scan", SCAN),
    "PoseInFrame": ("/odometry", {"frame_id": "odom", "pose": POSE}),
    "RawImage": ("/c/image", PIXELS),
    "CompressedImage": ("/d/image", {"frame_id": "cam", "data": "AQIDBA==", "format": "png"}),
    "CameraCalibration": ("/c/camera_info", LENS),
    "FrameTransform": ("/tf", EDGE),
    "FrameTransforms": ("/tf_static", {"transforms": [{"timestamp": {"sec": 1, "nsec": 0}, **EDGE}]}),
}


def _packed(topic: str, name: str, data: bytes) -> Message:
    return topic, f"foxglove.{name}", "protobuf", protobuf.SCHEMA, "protobuf", data


KINDS: dict[str, Any] = {
    "echoes": _echoes,
    "cloud": _cloud,
    "picture": _picture,
    "depth": _depth,
    "pose": _pose,
    "packed scan": lambda second: [_packed("/packed_scan", "LaserScan", protobuf.scan(second))],
    "packed pose": lambda second: [_packed("/packed_odom", "PoseInFrame", protobuf.pose(second))],
    **{
        name: lambda second, topic=topic, name=name, document=document: [_json(topic, name, document, second)]
        for name, (topic, document) in DOCUMENTS.items()
    },
}
