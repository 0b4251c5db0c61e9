"""Codecs of transforms: tf2_msgs/TFMessage and CSV rows."""

from __future__ import annotations

import math
from typing import Any

from gridslam.core.messages import Transform
from gridslam.logs.encoding.cdr import CdrWriter
from gridslam.logs.encoding.csv_fields import name_field, number_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message
from gridslam.logs.encoding.ros_fields import frame_name, head
from gridslam.logs.skips import SkipReason

FARTHEST_M = 1e9  # largest distance from parent to child: positions along any chain of transforms stay finite
_SMALLEST_QUATERNION_NORM = 1e-6
INVALID_STAMP_NS = -1


def unusable_reason(transform: Transform) -> SkipReason | None:
    """The reason why the transform is not a usable rigid motion; None if it is one."""
    if not all(map(math.isfinite, transform.translation_m)):
        return SkipReason.NOT_FINITE
    if max(map(abs, transform.translation_m)) > FARTHEST_M:
        return SkipReason.TOO_FAR
    norm = math.sqrt(sum(c * c for c in transform.quat_wxyz))
    is_rotation = math.isfinite(norm) and norm > _SMALLEST_QUATERNION_NORM
    return None if is_rotation else SkipReason.NOT_FINITE


def from_ros(message: Any, is_static: bool) -> list[Transform]:
    """The transforms in a tf2_msgs/TFMessage; an invalid stamp becomes INVALID_STAMP_NS."""
    found = []
    for item in message.transforms:
        stamp, parent = head(item)
        t, r = item.transform.translation, item.transform.rotation
        found.append(
            Transform(
                INVALID_STAMP_NS if stamp is None else stamp,
                parent,
                frame_name(item.child_frame_id),
                translation_m=(float(t.x), float(t.y), float(t.z)),
                quat_wxyz=(float(r.w), float(r.x), float(r.y), float(r.z)),
                is_static=is_static,
            )
        )
    return found


def to_ros(transform: Transform, topic: str | None) -> list[Encoded]:
    """One tf2_msgs/TFMessage with the transform; the default topic is /tf or /tf_static."""
    w, x, y, z = transform.quat_wxyz
    count = 1
    body = CdrWriter().uint32(count).header(transform.stamp_ns, transform.frame_id)
    body.text(transform.child_frame_id).float64(*transform.translation_m, x, y, z, w)
    default_topic = "/tf_static" if transform.is_static else "/tf"
    return single_message(topic or default_topic, "tf2_msgs/msg/TFMessage", transform, body)


def from_csv(rows: list[Row]) -> Transform:
    """The transform in one row, not marked as static."""
    (row,) = rows
    return Transform(
        row.stamp_ns,
        row.text("parent"),
        row.text("child"),
        translation_m=(row.number("x"), row.number("y"), row.number("z")),
        quat_wxyz=(row.number("qw"), row.number("qx"), row.number("qy"), row.number("qz")),
    )


def to_csv(transform: Transform, pictures: PictureWriter) -> list[list[str]]:
    """One row: parent, child, x, y, z, and quaternion w, x, y, z."""
    frames = (name_field(transform.frame_id), name_field(transform.child_frame_id))
    return [[*frames, *(number_field(v) for v in (*transform.translation_m, *transform.quat_wxyz))]]
