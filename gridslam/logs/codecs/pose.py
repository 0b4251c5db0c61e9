"""Codecs of absolute poses: geometry_msgs/PoseWithCovarianceStamped and CSV rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from gridslam.core.messages import AbsolutePose, readonly
from gridslam.logs.encoding.csv_fields import number_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header, write_planar_pose
from gridslam.logs.encoding.ros_fields import valid_head, yaw_of_orientation
from gridslam.logs.skips import SkipReason

_PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # x, y, yaw among x, y, z, roll, pitch, yaw


def unusable_reason(pose: AbsolutePose) -> SkipReason | None:
    """The reason why no method can use the pose; None if it can."""
    if not (np.isfinite(pose.pose).all() and np.isfinite(pose.covariance).all()):
        return SkipReason.NOT_FINITE
    return SkipReason.BAD_COVARIANCE if (np.diag(pose.covariance) < 0.0).any() else None


def from_ros(message: Any, topic: str) -> AbsolutePose:
    """The planar pose and its covariance in a geometry_msgs/PoseWithCovarianceStamped."""
    pose = message.pose.pose
    full = np.asarray(message.pose.covariance, dtype=np.float64).reshape(6, 6)
    planar = full[_PLANAR]
    planar = 0.5 * planar + 0.5 * planar.T  # publishers round the two halves differently
    values = np.array([pose.position.x, pose.position.y, yaw_of_orientation(pose.orientation)])
    return AbsolutePose(*valid_head(message), readonly(values, np.float64), readonly(planar, np.float64))


def to_ros(pose: AbsolutePose, topic: str | None) -> list[Encoded]:
    """One geometry_msgs/PoseWithCovarianceStamped."""
    full = np.zeros((6, 6))
    full[_PLANAR] = pose.covariance
    x, y, yaw = (float(v) for v in pose.pose)
    body = write_planar_pose(with_header(pose), x, y, yaw)
    body.float64(*(float(v) for v in full.ravel()))
    return single_message(topic or "/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", pose, body)


def from_csv(rows: list[Row]) -> AbsolutePose:
    """The pose in one row; covariances between x, y and yaw default to 0."""
    (row,) = rows
    pose = np.array([row.number("x"), row.number("y"), row.yaw()])
    xy, xt, yt = (row.number(name, 0.0) for name in ("cov_xy", "cov_xyaw", "cov_yyaw"))
    covariance = np.array(
        [[row.number("var_x"), xy, xt], [xy, row.number("var_y"), yt], [xt, yt, row.number("var_yaw")]]
    )
    return AbsolutePose(row.stamp_ns, row.frame, readonly(pose, np.float64), readonly(covariance, np.float64))


def to_csv(pose: AbsolutePose, pictures: PictureWriter) -> list[list[str]]:
    """One row: x, y, yaw, their variances, and the covariances of xy, x yaw and y yaw."""
    c = pose.covariance
    values = [*pose.pose, c[0, 0], c[1, 1], c[2, 2], c[0, 1], c[0, 2], c[1, 2]]
    return [[number_field(float(v)) for v in values]]
