"""MCAP files of foreign making: written with the mcap library and rosbags' own serialisation."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from gridslam.logs.codecs.tags import DEFINITION as TAG_INVENTORY

HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
HUMBLE.register(get_types_from_msg(TAG_INVENTORY, "gridslam_msgs/msg/TagInventory"))


def make(kind: str, **fields: Any) -> Any:
    """A message of rosbags; fields left out are zero, empty, or NaN-free defaults."""
    cls = HUMBLE.types[kind]
    values = {name: fields.get(name, _default(desc)) for name, desc in HUMBLE.fielddefs[kind][1]}
    return cls(**values)


def _default(desc: Any) -> Any:
    node, detail = desc
    if node.name == "BASE":
        return {"string": "", "bool": False}.get(detail[0], 0)
    if node.name == "NAME":
        return make(detail)
    inner, length = detail
    if inner[0].name == "BASE" and inner[1][0] != "string":
        kinds = {"float64": np.float64, "float32": np.float32, "octet": np.uint8}
        return np.zeros(length or 0, kinds.get(inner[1][0]) or np.dtype(inner[1][0]).type)
    return []


def header(stamp_ns: int, frame: str = "frame") -> Any:
    """std_msgs/Header."""
    stamp = make("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def scan(
    stamp_ns: int, ranges: Iterable[float] = (1.0, 2.0, 3.0), frame: str = "laser", **fields: Any
) -> Any:
    """sensor_msgs/LaserScan with intensities."""
    values = np.array(list(ranges), np.float32)
    usual = {"angle_min": -1.0, "angle_max": 1.0, "angle_increment": 0.5, "range_min": 0.1, "range_max": 30.0}
    return make(
        "sensor_msgs/msg/LaserScan",
        header=header(stamp_ns, frame),
        ranges=values,
        intensities=np.ones_like(values),
        **{**usual, **fields},
    )


def odometry(stamp_ns: int, x: float = 0.0, child: str = "base_link") -> Any:
    """nav_msgs/Odometry."""
    message = make("nav_msgs/msg/Odometry", header=header(stamp_ns, "odom"), child_frame_id=child)
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1.0
    return message


def transform(
    stamp_ns: int,
    parent: str,
    child: str,
    xyz: tuple[float, float, float],
    wxyz: tuple[float, ...] = (1, 0, 0, 0),
) -> Any:
    """geometry_msgs/TransformStamped."""
    message = make(
        "geometry_msgs/msg/TransformStamped", header=header(stamp_ns, parent), child_frame_id=child
    )
    t, r = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = xyz
    r.w, r.x, r.y, r.z = wxyz
    return message


def tf(*transforms: Any) -> Any:
    """tf2_msgs/TFMessage."""
    return make("tf2_msgs/msg/TFMessage", transforms=list(transforms))


def write_mcap(
    path: Path,
    messages: Iterable[tuple[str, Any]],
    schema_encoding: str = "ros2msg",
    little_endian: bool = True,
) -> Path:
    """(topic, message) pairs in this order; log times count up by themselves."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channels: dict[tuple[str, str], int] = {}
        for number, (topic, message) in enumerate(messages):
            kind = message.__msgtype__
            if (topic, kind) not in channels:
                text = (
                    HUMBLE.generate_msgdef(kind, ros_version=2)[0]
                    if schema_encoding == "ros2msg"
                    else IDL[kind]
                )
                schema = writer.register_schema(kind, schema_encoding, text.encode())
                channels[topic, kind] = writer.register_channel(topic, "cdr", schema)
            data = bytes(HUMBLE.serialize_cdr(message, kind, little_endian=little_endian))
            writer.add_message(channels[topic, kind], number, data, number)
        writer.finish()
    return path


def write_json(path: Path, messages: Iterable[tuple[str, str, dict[str, Any]]]) -> Path:
    """(topic, schema name, document) triples as JSON messages."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels: dict[str, int] = {}
        for number, (topic, name, document) in enumerate(messages):
            if topic not in channels:
                channels[topic] = writer.register_channel(
                    topic, "json", writer.register_schema(name, "jsonschema", b"{}")
                )
            writer.add_message(channels[topic], number, json.dumps(document).encode(), number)
        writer.finish()
    return path


IDL = {
    "sensor_msgs/msg/LaserScan": """\
================================================================================
IDL: sensor_msgs/msg/LaserScan
#include "std_msgs/msg/Header.idl"
module sensor_msgs {
  module msg {
    struct LaserScan {
      std_msgs::msg::Header header;
      float angle_min;
      float angle_max;
      float angle_increment;
      float time_increment;
      float scan_time;
      float range_min;
      float range_max;
      sequence<float> ranges;
      sequence<float> intensities;
    };
  };
};
================================================================================
IDL: std_msgs/msg/Header
#include "builtin_interfaces/msg/Time.idl"
module std_msgs {
  module msg {
    struct Header {
      builtin_interfaces::msg::Time stamp;
      string frame_id;
    };
  };
};
================================================================================
IDL: builtin_interfaces/msg/Time
module builtin_interfaces {
  module msg {
    struct Time {
      int32 sec;
      uint32 nanosec;
    };
  };
};
"""
}
