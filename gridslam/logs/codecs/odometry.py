"""Odometry: checks, nav_msgs/Odometry, geometry_msgs/PoseStamped, foxglove.PoseInFrame, rows of CSV."""

from __future__ import annotations

import math
from typing import Any

from gridslam.core.messages import Odometry, Transform, canonical_yaw
from gridslam.logs.csv.fields import number_field
from gridslam.logs.csv.pictures import PictureWriter
from gridslam.logs.csv.row import Row
from gridslam.logs.ros.encoded import Encoded, single_message, with_header, write_planar_pose
from gridslam.logs.ros.fields import valid_head, yaw_of_orientation
from gridslam.logs.rotations import yaw_of
from gridslam.logs.skips import SkipReason

_NO_COVARIANCE = (0.0,) * 36


def fault(odometry: Odometry) -> SkipReason | None:
    """The reason why no method can use the odometry; None where it can."""
    # Each number by itself: the sum of finite numbers may overflow.
    if math.isfinite(odometry.x_m) and math.isfinite(odometry.y_m) and math.isfinite(odometry.yaw_rad):
        return None
    return SkipReason.NOT_FINITE


def from_ros(message: Any, topic: str) -> Odometry:
    """The odometry of a decoded nav_msgs/Odometry."""
    pose, twist = message.pose.pose, message.twist.twist
    return Odometry(
        *valid_head(message),
        x_m=float(pose.position.x),
        y_m=float(pose.position.y),
        yaw_rad=yaw_of_orientation(pose.orientation),
        vx_mps=float(twist.linear.x),
        wz_radps=float(twist.angular.z),
        child_frame_id=str(message.child_frame_id).lstrip("/") or "base_link",
    )


def from_pose_stamped(message: Any, topic: str) -> Odometry:
    """The pose of a decoded geometry_msgs/PoseStamped, without velocities."""
    position = message.pose.position
    return Odometry(
        *valid_head(message),
        x_m=float(position.x),
        y_m=float(position.y),
        yaw_rad=yaw_of_orientation(message.pose.orientation),
    )


def from_foxglove(stamp_ns: int, frame: str, message: Any, topic: str) -> Odometry:
    """The pose of a foxglove.PoseInFrame, without velocities."""
    position, q = message.pose.position, message.pose.orientation
    yaw = canonical_yaw(yaw_of((float(q.w), float(q.x), float(q.y), float(q.z))))
    return Odometry(stamp_ns, frame, float(position.x), float(position.y), yaw)


def from_transform(transform: Transform) -> Odometry:
    """The transform odom->base as odometry."""
    x, y, _ = transform.translation_m
    yaw = canonical_yaw(yaw_of(transform.quat_wxyz))
    return Odometry(
        transform.stamp_ns, transform.frame_id, x, y, yaw, child_frame_id=transform.child_frame_id
    )


def to_ros(odometry: Odometry, topic: str | None) -> list[Encoded]:
    """nav_msgs/Odometry with covariances of zero, which mean unknown."""
    body = with_header(odometry).text(odometry.child_frame_id)
    write_planar_pose(body, odometry.x_m, odometry.y_m, odometry.yaw_rad).float64(*_NO_COVARIANCE)
    body.float64(odometry.vx_mps, 0.0, 0.0, 0.0, 0.0, odometry.wz_radps).float64(*_NO_COVARIANCE)
    return single_message(topic or "/odom", "nav_msgs/msg/Odometry", odometry, body)


def from_csv(rows: list[Row]) -> Odometry:
    """The odometry of one row."""
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


def to_csv(o: Odometry, pictures: PictureWriter) -> list[list[str]]:
    """One row; velocities that are unknown are empty fields."""
    return [[number_field(v) for v in (o.x_m, o.y_m, o.yaw_rad, o.vx_mps, o.wz_radps)]]
