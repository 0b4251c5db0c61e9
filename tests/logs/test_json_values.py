"""Values of JSON messages that no other encoding can have: null, lists of lists, numbers where a text belongs."""

from __future__ import annotations

import copy
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from gridslam.core.messages import CameraInfo, LaserScan
from gridslam.logs.open import open_log

S = 10**9
HEADER = {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "f"}
ROTATION = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
PLACE = {"x": 0.1, "y": 0.2, "z": 0.3}
SCAN = {
    "header": HEADER, "angle_min": -1.0, "angle_max": 1.0, "angle_increment": 1.0, "time_increment": 0.0, "scan_time": 0.0,
    "range_min": 0.1, "range_max": 30.0, "ranges": [1.0, 2.0, 3.0], "intensities": [],
}  # fmt: skip
FOXGLOVE_SCAN = {
    "timestamp": {"sec": 1, "nsec": 0}, "frame_id": "f", "start_angle": -1.0, "end_angle": 1.0,
    "ranges": [1.0, 2.0, 3.0], "intensities": [],
}  # fmt: skip
EDGE = {
    "timestamp": {"sec": 1, "nsec": 0}, "parent_frame_id": "base_link", "child_frame_id": "f",
    "translation": PLACE, "rotation": ROTATION,
}  # fmt: skip
LENS = {
    "header": HEADER, "height": 1, "width": 4, "distortion_model": "plumb_bob", "d": [0.0] * 5,
    "k": [10.0, 0, 2, 0, 10, 1, 0, 0, 1],
    "r": [1.0, 0, 0, 0, 1, 0, 0, 0, 1], "p": [10.0, 0, 2, 0, 0, 10, 1, 0, 0, 0, 1, 0],
}  # fmt: skip
CLOUD = {"header": HEADER, "points": [{"x": 1.0, "y": 1.0, "z": 1.0, "offset_time": 0}]}
TYPES = {
    "sensor_msgs/msg/LaserScan": ("/scan", SCAN),
    "foxglove.LaserScan": ("/scan", FOXGLOVE_SCAN),
    "foxglove.FrameTransform": ("/tf", EDGE),
    "sensor_msgs/msg/CameraInfo": ("/c/camera_info", LENS),
    "livox_ros_driver2/msg/CustomMsg": ("/livox", CLOUD),
}


def log_of(path: Path, name: str, *changes: dict[str, Any]) -> Path:
    """A log of messages of one type, each with fields changed; a key may be a path with dots."""
    topic, document = TYPES[name]
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(topic, "json", writer.register_schema(name, "jsonschema", b"{}"))
        for number, change in enumerate(changes, start=1):
            message = copy.deepcopy(document)
            for key, value in change.items():
                inner: Any = message
                *parts, last = key.split(".")
                for part in parts:
                    inner = inner[part] if isinstance(inner, dict) else inner[int(part)]
                inner[last] = value
            writer.add_message(channel, number * S, json.dumps(message).encode(), number * S)
        writer.finish()
    return path


def read(path: Path) -> tuple[list[Any], list[str], list[str]]:
    """The events but static transforms, all frames, and the problems; a warning of a library is an error."""
    with warnings.catch_warnings(), open_log(path) as log:
        warnings.simplefilter("error")
        events = [event for event in log.events() if not getattr(event, "is_static", False)]
        frames = [event.frame_id for event in events]
        frames += [f"{info.frame}{info.detail}" for info in log.streams]
        return events, frames, log.problems


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("sensor_msgs/msg/LaserScan", "header.frame_id"),
        ("foxglove.LaserScan", "frame_id"),
        ("foxglove.FrameTransform", "parent_frame_id"),
        ("foxglove.FrameTransform", "child_frame_id"),
        ("sensor_msgs/msg/CameraInfo", "header.frame_id"),
        ("sensor_msgs/msg/CameraInfo", "distortion_model"),
    ],
)
def test_null_is_no_name(tmp_path: Path, name: str, key: str) -> None:
    events, frames, _ = read(log_of(tmp_path / "log.mcap", name, {key: None}))
    assert "None" not in repr(frames)
    assert "'None'" not in repr(events)


@pytest.mark.parametrize("value", [True, 1.5, [], {}])
def test_a_name_that_is_no_text_is_counted(tmp_path: Path, value: object) -> None:
    log = log_of(tmp_path / "log.mcap", "foxglove.LaserScan", {}, {"frame_id": value})
    events, _, problems = read(log)
    assert len(events) == 1
    assert problems[-1:] == ["skipped 1 x scan.undecodable, first at /scan message 2"]


def test_a_frame_that_is_a_number_keeps_its_digits(tmp_path: Path) -> None:
    (scan,), _, _ = read(log_of(tmp_path / "log.mcap", "foxglove.LaserScan", {"frame_id": 7}))
    assert scan.frame_id == "7"


@pytest.mark.parametrize("name", ["sensor_msgs/msg/LaserScan", "foxglove.LaserScan"])
@pytest.mark.parametrize("ranges", [None, 5, "1.5", [[1, 2], [3, 4]]])
def test_ranges_that_are_no_list_are_no_scan(tmp_path: Path, name: str, ranges: object) -> None:
    events, _, problems = read(log_of(tmp_path / "log.mcap", name, {}, {"ranges": ranges}))
    assert len(events) == 1
    assert problems[-1:] == ["skipped 1 x scan.undecodable, first at /scan message 2"]


@pytest.mark.parametrize("name", ["sensor_msgs/msg/LaserScan", "foxglove.LaserScan"])
def test_null_among_ranges_is_no_return(tmp_path: Path, name: str) -> None:
    (scan,), _, _ = read(log_of(tmp_path / "log.mcap", name, {"ranges": [1.0, None, 3.0]}))
    assert isinstance(scan, LaserScan)
    np.testing.assert_array_equal(scan.ranges_m, np.array([1.0, np.nan, 3.0], np.float32))


@pytest.mark.parametrize("coefficients", [None, 5.0])
def test_distortion_that_is_no_list_is_no_calibration(tmp_path: Path, coefficients: object) -> None:
    log = log_of(tmp_path / "log.mcap", "sensor_msgs/msg/CameraInfo", {}, {"d": coefficients})
    (info,), _, problems = read(log)
    assert isinstance(info, CameraInfo)
    assert problems[-1:] == ["skipped 1 x camera info.undecodable, first at /c/camera_info message 2"]


def test_points_too_large_for_a_float_are_left_out_without_a_word_of_a_library(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log.mcap", "livox_ros_driver2/msg/CustomMsg", {}, {"points.0.x": 1e308})
    first, second = read(log)[0]
    assert len(first.points_m) == 1
    assert len(second.points_m) == 0
