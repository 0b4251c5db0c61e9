"""From events to ROS 2 messages in CDR."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gridslam.core.errors import LogError
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
    StereoPair,
    TagInventory,
    Transform,
    WheelTicks,
    as_float32,
)
from gridslam.core.poses import quaternion_of_yaw
from gridslam.logs.ros.cdr import CdrWriter
from gridslam.logs.stamps import END_NS


@dataclass(frozen=True, slots=True)
class Encoded:
    """One message of a topic."""

    topic: str
    type: str
    stamp_ns: int
    data: bytes


def encode(event: Event, topic: str | None = None) -> Iterable[Encoded]:
    """The messages that stand for an event: one, but two for a stereo pair and for a ranger on a servo."""
    if not 0 <= event.stamp_ns < END_NS:
        raise LogError(
            f"stamp {event.stamp_ns} ns of a {type(event).__name__} cannot be written: ROS holds 0 to 2^31 s"
        )
    return _ENCODERS[type(event)](event, topic)


def _begin(event: Any) -> CdrWriter:
    return CdrWriter().header(event.stamp_ns, event.frame_id)


def _one(topic: str, kind: str, event: Any, body: CdrWriter) -> list[Encoded]:
    return [Encoded(topic, kind, event.stamp_ns, body.data())]


def _yaw_pose(body: CdrWriter, x: float, y: float, yaw: float) -> CdrWriter:
    w, qx, qy, qz = (float(v) for v in quaternion_of_yaw(yaw))
    return body.float64(x, y, 0.0, qx, qy, qz, w)


def _scan(scan: LaserScan, topic: str | None) -> list[Encoded]:
    last = as_float32(scan.angle_min_rad + (len(scan.ranges_m) - 1) * scan.angle_increment_rad)
    body = _begin(scan).float32(
        scan.angle_min_rad,
        last,
        scan.angle_increment_rad,
        scan.time_increment_s,
        0.0,
        scan.range_min_m,
        scan.range_max_m,
    )
    body.sequence(scan.ranges_m, 4).uint32(0)
    return _one(topic or "/scan", "sensor_msgs/msg/LaserScan", scan, body)


def _odometry(odometry: Odometry, topic: str | None) -> list[Encoded]:
    body = _begin(odometry).text(odometry.child_frame_id)
    _yaw_pose(body, odometry.x_m, odometry.y_m, odometry.yaw_rad).float64(*[0.0] * 36)
    body.float64(odometry.vx_mps, 0.0, 0.0, 0.0, 0.0, odometry.wz_radps).float64(*[0.0] * 36)
    return _one(topic or "/odom", "nav_msgs/msg/Odometry", odometry, body)


def _imu(imu: Imu, topic: str | None) -> list[Encoded]:
    unknown = [-1.0, *[0.0] * 8]  # a first covariance of -1 says: not measured
    body = _begin(imu).float64(0.0, 0.0, 0.0, 1.0, *unknown, 0.0, 0.0, imu.wz_radps, *[0.0] * 9)
    body.float64(0.0, 0.0, 0.0, *unknown)
    return _one(topic or "/imu", "sensor_msgs/msg/Imu", imu, body)


def _joints(event: Any, names: list[str], angles: list[float]) -> CdrWriter:
    body = _begin(event).texts(names)
    body.sequence(np.array(angles, dtype=np.float64), 8)
    return body.uint32(0).uint32(0)


def _wheels(ticks: WheelTicks, topic: str | None) -> list[Encoded]:
    body = _joints(ticks, ["left_wheel", "right_wheel"], [ticks.left_rad, ticks.right_rad])
    return _one(topic or "/joint_states", "sensor_msgs/msg/JointState", ticks, body)


def _range(reading: Range, topic: str | None) -> list[Encoded]:
    """The servo's angle goes before the reading, as a joint with the ranger's name."""
    topic = topic or "/range"
    servo = _joints(reading, [reading.frame_id], [reading.bearing_rad])
    infrared, field_of_view = 1, 0.0
    body = _begin(reading).uint8(infrared).float32(field_of_view, reading.range_min_m, reading.range_max_m)
    body.float32(reading.range_m)
    servos = _one(f"{topic}/servo", "sensor_msgs/msg/JointState", reading, servo)
    return servos + _one(topic, "sensor_msgs/msg/Range", reading, body)


def _fix(fix: AbsolutePose, topic: str | None) -> list[Encoded]:
    full = np.zeros((6, 6))
    full[np.ix_([0, 1, 5], [0, 1, 5])] = fix.covariance
    body = _yaw_pose(_begin(fix), float(fix.pose[0]), float(fix.pose[1]), float(fix.pose[2]))
    body.float64(*(float(v) for v in full.ravel()))
    return _one(topic or "/fix", "geometry_msgs/msg/PoseWithCovarianceStamped", fix, body)


def _picture(body: CdrWriter, encoding: str, pixels: Any, bytes_per_pixel: int) -> CdrWriter:
    height, width = pixels.shape[:2]
    body.uint32(height, width).text(encoding).uint8(0).uint32(width * bytes_per_pixel)
    raw = np.ascontiguousarray(pixels).astype(pixels.dtype.newbyteorder("<"), copy=False)
    return body.sequence(raw.reshape(-1).view(np.uint8), 1)


def _image(image: Image, topic: str | None) -> list[Encoded]:
    encoding, size = ("mono8", 1) if image.pixels.ndim == 2 else ("rgb8", 3)
    body = _picture(_begin(image), encoding, image.pixels, size)
    return _one(topic or f"/{image.camera or 'camera'}/image", "sensor_msgs/msg/Image", image, body)


def _stereo(pair: StereoPair, topic: str | None) -> list[Encoded]:
    root = topic or "/stereo"
    sides = (("left", pair.left), ("right", pair.right))
    return [
        Encoded(
            f"{root}/{side}/image_rect",
            "sensor_msgs/msg/Image",
            pair.stamp_ns,
            _picture(_begin(pair), "mono8", pixels, 1).data(),
        )
        for side, pixels in sides
    ]


def _depth(depth: DepthImage, topic: str | None) -> list[Encoded]:
    body = _picture(_begin(depth), "32FC1", depth.depth_m, 4)
    return _one(topic or f"/{depth.camera or 'camera'}/depth", "sensor_msgs/msg/Image", depth, body)


def _disparity(disparity: Disparity, topic: str | None) -> list[Encoded]:
    body = _picture(
        _begin(disparity).header(disparity.stamp_ns, disparity.frame_id), "32FC1", disparity.disparity_px, 4
    )
    body.float32(disparity.focal_px, disparity.baseline_m)
    body.uint32(0, 0, 0, 0).uint8(0).float32(0.0, as_float32(disparity.disparity_px.shape[1]), 0.0)
    return _one(
        topic or f"/{disparity.camera or 'camera'}/disparity",
        "stereo_msgs/msg/DisparityImage",
        disparity,
        body,
    )


def _camera_info(info: CameraInfo, topic: str | None) -> list[Encoded]:
    body = _begin(info).uint32(info.height_px, info.width_px).text("plumb_bob")
    body.sequence(np.asarray(info.D, dtype=np.float64), 8)
    rectification = np.eye(3)
    for matrix in (info.K, rectification, info.P):
        body.float64(*(float(v) for v in np.ravel(matrix)))
    body.uint32(0, 0).uint32(0, 0, 0, 0).uint8(0)
    return _one(topic or f"/{info.camera or 'camera'}/camera_info", "sensor_msgs/msg/CameraInfo", info, body)


def _tags(tags: TagInventory, topic: str | None) -> list[Encoded]:
    body = _begin(tags).text(tags.antenna).texts(tags.tag_ids)
    body.sequence(np.array(tags.rssi_dbm, dtype=np.float32), 4)
    return _one(topic or "/tags", "gridslam_msgs/msg/TagInventory", tags, body)


def _transform(transform: Transform, topic: str | None) -> list[Encoded]:
    w, x, y, z = transform.quat_wxyz
    body = CdrWriter().uint32(1).header(transform.stamp_ns, transform.frame_id).text(transform.child_frame_id)
    body.float64(*transform.translation_m, x, y, z, w)
    usual = "/tf_static" if transform.is_static else "/tf"
    return _one(topic or usual, "tf2_msgs/msg/TFMessage", transform, body)


_ENCODERS: dict[type, Callable[[Any, str | None], list[Encoded]]] = {
    LaserScan: _scan,
    Odometry: _odometry,
    Imu: _imu,
    WheelTicks: _wheels,
    Range: _range,
    AbsolutePose: _fix,
    Image: _image,
    StereoPair: _stereo,
    DepthImage: _depth,
    Disparity: _disparity,
    CameraInfo: _camera_info,
    TagInventory: _tags,
    Transform: _transform,
}
