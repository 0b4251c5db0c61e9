"""ROS messages in CDR, with what a container needs to store them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gridslam.core.poses import quaternion_of_yaw
from gridslam.logs.encoding.cdr import CdrWriter


@dataclass(frozen=True, slots=True)
class Encoded:
    """One message of a topic: `type` is its full name (`sensor_msgs/msg/LaserScan`), `data` its CDR bytes."""

    topic: str
    type: str
    stamp_ns: int
    data: bytes


def with_header(event: Any) -> CdrWriter:
    """A CDR writer that holds the event's std_msgs/Header."""
    return CdrWriter().header(event.stamp_ns, event.frame_id)


def single_message(topic: str, type_name: str, event: Any, body: CdrWriter) -> list[Encoded]:
    """The encoding of an event that takes one message."""
    return [Encoded(topic, type_name, event.stamp_ns, body.data())]


def write_planar_pose(body: CdrWriter, x_m: float, y_m: float, yaw_rad: float) -> CdrWriter:
    """Append a geometry_msgs/Pose in the plane z = 0."""
    w, qx, qy, qz = (float(v) for v in quaternion_of_yaw(yaw_rad))
    return body.float64(x_m, y_m, 0.0, qx, qy, qz, w)
