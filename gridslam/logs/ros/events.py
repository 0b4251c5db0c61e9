"""From decoded ROS messages (any object with the message's fields) to events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
    Event,
    Image,
    Imu,
    LaserScan,
    Odometry,
    Range,
    TagInventory,
    Transform,
    as_float32,
    canonical_yaw,
    readonly,
)
from gridslam.logs.cameras import DEPTH_ENCODINGS, camera_of, depth_of, pixels_of, unpack_picture
from gridslam.logs.ros.joints import JointState
from gridslam.logs.rotations import yaw_of
from gridslam.logs.stamps import join_stamp


def head(message: Any) -> tuple[int | None, str]:
    """(stamp_ns, frame) of a message with a header; None for a stamp that is none."""
    header = message.header
    return join_stamp(int(header.stamp.sec), int(header.stamp.nanosec)), str(header.frame_id).lstrip("/")


def _stamp(message: Any) -> tuple[int, str]:
    stamp, frame = head(message)
    if stamp is None:
        raise ValueError("bad stamp")
    return stamp, frame


def _yaw(orientation: Any) -> float:
    return canonical_yaw(yaw_of((orientation.w, orientation.x, orientation.y, orientation.z)))


def scan(message: Any, topic: str) -> Event:
    """sensor_msgs/LaserScan."""
    return LaserScan(
        *_stamp(message),
        readonly(message.ranges, np.float32),
        as_float32(message.angle_min),
        as_float32(message.angle_increment),
        as_float32(message.range_min),
        as_float32(message.range_max),
        as_float32(message.time_increment),
    )


def odometry(message: Any, topic: str) -> Event:
    """nav_msgs/Odometry."""
    pose, twist = message.pose.pose, message.twist.twist
    return Odometry(
        *_stamp(message),
        float(pose.position.x),
        float(pose.position.y),
        _yaw(pose.orientation),
        float(twist.linear.x),
        float(twist.angular.z),
        str(message.child_frame_id).lstrip("/") or "base_link",
    )


def imu(message: Any, topic: str) -> Event:
    """sensor_msgs/Imu."""
    return Imu(*_stamp(message), float(message.angular_velocity.z))


def reading(message: Any, bearing_of: Callable[[str], float]) -> Event:
    """sensor_msgs/Range with the angle of the servo that turns its frame."""
    stamp_ns, frame = _stamp(message)
    return Range(
        stamp_ns,
        frame,
        bearing_of(frame),
        as_float32(message.range),
        as_float32(message.min_range),
        as_float32(message.max_range),
    )


def fix(message: Any, topic: str) -> Event:
    """geometry_msgs/PoseWithCovarianceStamped: of the 6 x 6 covariance the rows and columns of x, y, yaw."""
    pose = message.pose.pose
    full = np.asarray(message.pose.covariance, dtype=np.float64).reshape(6, 6)
    planar = full[np.ix_([0, 1, 5], [0, 1, 5])]
    planar = 0.5 * (planar + planar.T)  # publishers round the two halves differently
    values = np.array([pose.position.x, pose.position.y, _yaw(pose.orientation)])
    return AbsolutePose(*_stamp(message), readonly(values, np.float64), readonly(planar, np.float64))


def pose(message: Any, topic: str) -> Event:
    """geometry_msgs/PoseStamped, as a path's point."""
    place, orientation = message.pose.position, message.pose.orientation
    return Odometry(*_stamp(message), float(place.x), float(place.y), _yaw(orientation))


def image(message: Any, topic: str) -> Event:
    """sensor_msgs/Image in colour or grey."""
    pixels = pixels_of(
        str(message.encoding), int(message.height), int(message.width), int(message.step), bytes(message.data)
    )
    return Image(*_stamp(message), readonly(pixels, np.uint8), camera_of(topic))


def depth(message: Any, topic: str) -> Event:
    """sensor_msgs/Image of depths."""
    metres = depth_of(
        str(message.encoding),
        int(message.height),
        int(message.width),
        int(message.step),
        bytes(message.data),
        bool(message.is_bigendian),
    )
    return DepthImage(*_stamp(message), readonly(metres, np.float32), camera_of(topic))


def compressed(message: Any, topic: str) -> Event:
    """sensor_msgs/CompressedImage."""
    pixels = unpack_picture(bytes(message.data))
    return Image(*_stamp(message), readonly(pixels, np.uint8), camera_of(topic))


def camera_info(message: Any, topic: str) -> Event:
    """sensor_msgs/CameraInfo."""
    return CameraInfo(
        *_stamp(message),
        int(message.width),
        int(message.height),
        readonly(np.asarray(message.k).reshape(3, 3), np.float64),
        readonly(np.asarray(message.p).reshape(3, 4), np.float64),
        readonly(message.d, np.float64),
        camera_of(topic),
    )


def disparity(message: Any, topic: str) -> Event:
    """stereo_msgs/DisparityImage; values below its least disparity, and not finite ones, are no match
    (NaN).
    """
    picture = message.image
    if str(picture.encoding) != "32FC1":
        raise ValueError(f"encoding {picture.encoding!r}")
    values = depth_of(
        "32FC1",
        int(picture.height),
        int(picture.width),
        int(picture.step),
        bytes(picture.data),
        bool(picture.is_bigendian),
    )
    with np.errstate(invalid="ignore"):
        values = np.where(np.isfinite(values) & (values >= message.min_disparity), values, np.float32(np.nan))
    return Disparity(
        *_stamp(message),
        readonly(values, np.float32),
        as_float32(message.f),
        as_float32(message.t),
        camera_of(topic),
    )


def tags(message: Any, topic: str) -> Event:
    """gridslam_msgs/TagInventory."""
    return TagInventory(
        *_stamp(message),
        str(message.antenna),
        tuple(str(t) for t in message.tag_ids),
        tuple(as_float32(r) for r in message.rssi_dbm),
    )


CONVERTERS: dict[str, Callable[[Any, str], Event]] = {
    "sensor_msgs/msg/LaserScan": scan,
    "nav_msgs/msg/Odometry": odometry,
    "sensor_msgs/msg/Imu": imu,
    "geometry_msgs/msg/PoseWithCovarianceStamped": fix,
    "geometry_msgs/msg/PoseStamped": pose,
    "sensor_msgs/msg/Image": image,
    "sensor_msgs/msg/CompressedImage": compressed,
    "sensor_msgs/msg/CameraInfo": camera_info,
    "stereo_msgs/msg/DisparityImage": disparity,
    "gridslam_msgs/msg/TagInventory": tags,
}


def is_depth(message: Any) -> bool:
    """Whether an Image holds depths rather than colours."""
    return str(message.encoding) in DEPTH_ENCODINGS


def joints(message: Any) -> JointState:
    """sensor_msgs/JointState."""
    return JointState(
        *head(message), [str(n) for n in message.name], np.asarray(message.position, np.float64).tolist()
    )


def transforms(message: Any, static: bool) -> list[Transform]:
    """tf2_msgs/TFMessage. Transforms without a valid stamp get stamp -1."""
    found = []
    for item in message.transforms:
        stamp, parent = head(item)
        t, r = item.transform.translation, item.transform.rotation
        found.append(
            Transform(
                -1 if stamp is None else stamp,
                parent,
                str(item.child_frame_id).lstrip("/"),
                (float(t.x), float(t.y), float(t.z)),
                (float(r.w), float(r.x), float(r.y), float(r.z)),
                static,
            )
        )
    return found
