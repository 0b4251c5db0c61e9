"""Codecs of odometry: nav_msgs/Odometry, geometry_msgs/PoseStamped, foxglove.PoseInFrame, transforms and CSV rows."""

from __future__ import annotations

import math
from typing import Any

from gridslam.core.messages import Odometry, Transform
from gridslam.logs.encoding.csv_fields import number_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header, write_planar_pose
from gridslam.logs.encoding.ros_fields import frame_name, valid_head, yaw_of_orientation
from gridslam.logs.rotations import heading_of
from gridslam.logs.skips import SkipReason

_NO_COVARIANCE = (0.0,) * 36


def unusable_reason(odometry: Odometry) -> SkipReason | None:
    """NOT_FINITE if the position or yaw is NaN or infinite; None if the odometry is usable."""
    return None if odometry.is_finite else SkipReason.NOT_FINITE


def from_ros(message: Any, topic: str) -> Odometry:
    """Odometry from a decoded nav_msgs/Odometry: planar pose, forward speed and yaw rate."""
    pose, twist = message.pose.pose, message.twist.twist
    return Odometry(
        *valid_head(message),
        x_m=float(pose.position.x),
        y_m=float(pose.position.y),
        yaw_rad=yaw_of_orientation(pose.orientation),
        vx_mps=float(twist.linear.x),
        wz_radps=float(twist.angular.z),
        child_frame_id=frame_name(message.child_frame_id) or "base_link",
    )


def is_odometry(message: Any, topic: str) -> bool:
    """Whether a decoded foxglove.PoseInFrame is odometry: its frame is an odometry frame."""
    return "odom" in str(message.frame_id)


def from_pose_stamped(message: Any, topic: str) -> Odometry:
    """Odometry from a decoded geometry_msgs/PoseStamped; its velocities are unknown (NaN)."""
    position = message.pose.position
    return Odometry(
        *valid_head(message),
        x_m=float(position.x),
        y_m=float(position.y),
        yaw_rad=yaw_of_orientation(message.pose.orientation),
    )


def from_foxglove(stamp_ns: int, frame: str, message: Any, topic: str) -> Odometry:
    """Odometry from a decoded foxglove.PoseInFrame; its velocities are unknown (NaN)."""
    position, q = message.pose.position, message.pose.orientation
    yaw = heading_of((float(q.w), float(q.x), float(q.y), float(q.z)))
    return Odometry(stamp_ns, frame, float(position.x), float(position.y), yaw)


def from_transform(transform: Transform) -> Odometry:
    """Odometry from a transform T_odom_base; its velocities are unknown (NaN)."""
    x, y, _ = transform.translation_m
    yaw = heading_of(transform.quat_wxyz)
    return Odometry(
        transform.stamp_ns, transform.frame_id, x, y, yaw, child_frame_id=transform.child_frame_id
    )


def to_ros(odometry: Odometry, topic: str | None) -> list[Encoded]:
    """One nav_msgs/Odometry message; its covariances are zero, which means unknown."""
    body = with_header(odometry).text(odometry.child_frame_id)
    write_planar_pose(body, odometry.x_m, odometry.y_m, odometry.yaw_rad).float64(*_NO_COVARIANCE)
    body.float64(odometry.vx_mps, 0.0, 0.0, 0.0, 0.0, odometry.wz_radps).float64(*_NO_COVARIANCE)
    return single_message(topic or "/odom", "nav_msgs/msg/Odometry", odometry, body)


def from_csv(rows: list[Row]) -> Odometry:
    """Odometry from one CSV row; missing velocities are NaN."""
    (row,) = rows
    return Odometry(
        row.stamp_ns,
        row.frame,
        x_m=row.number("x"),
        y_m=row.number("y"),
        yaw_rad=row.yaw(),
        vx_mps=row.number("vx", math.nan),
        wz_radps=row.number("wz", math.nan),
        child_frame_id=row.child_frame(),
    )


def to_csv(odometry: Odometry, pictures: PictureWriter) -> list[list[str]]:
    """One CSV row: x, y, yaw, vx, wz; unknown velocities are empty fields."""
    values = (odometry.x_m, odometry.y_m, odometry.yaw_rad, odometry.vx_mps, odometry.wz_radps)
    return [[number_field(v) for v in values]]
