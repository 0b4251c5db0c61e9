"""Point clouds: sensor_msgs/PointCloud2 of any field layout, and livox_ros_driver's CustomMsg."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import PointCloud, readonly
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head
from gridslam.logs.skips import SkipReason, UnusableMessageError

# sensor_msgs/PointField: datatype -> numpy's letter and size
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# Names that drivers give to the time of a point: Ouster, Velodyne, Hesai and RoboSense, Livox.
_TIME_FIELDS = ("t", "time", "timestamp", "time_stamp", "offset_time", "time_offset")
_ABSOLUTE_FROM_S = 1e6  # a time later than eleven days after the header is no offset but a stamp
_MAX_DELAY_S = 60.0  # largest difference of the stamp of a point from the header's
_UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
_SWEEPS_S = (0.003, 3.0)  # times that lidars take for a cloud: in one unit only
_MAX_POINTS = 4_000_000


def from_ros(message: Any, topic: str) -> PointCloud:
    """The cloud of a decoded sensor_msgs/PointCloud2; points without finite coordinates are left out."""
    stamp_ns, frame = valid_head(message)
    fields = {str(field.name): field for field in message.fields}
    count = int(message.width) * int(message.height)
    if not {"x", "y", "z"} <= fields.keys():
        raise UnusableMessageError(SkipReason.NO_COORDINATES)
    if count > _MAX_POINTS:
        raise UnusableMessageError(SkipReason.TOO_MANY_POINTS)
    points = np.empty((count, 3), np.float32)
    for axis, name in enumerate("xyz"):
        points[:, axis] = _column(message, fields[name])
    usable = np.isfinite(points).all(axis=1)
    times = next((fields[name] for name in _TIME_FIELDS if name in fields), None)
    offsets = np.zeros(0, np.float32) if times is None else _offsets_s(message, times, stamp_ns)
    return PointCloud(
        stamp_ns,
        frame,
        readonly(points[usable], np.float32),
        readonly(offsets[usable] if len(offsets) else offsets, np.float32),
    )


def from_livox(message: Any, topic: str) -> PointCloud:
    """The cloud of a decoded livox_ros_driver(2)/CustomMsg; points at the origin are no returns."""
    stamp_ns, frame = valid_head(message)
    if len(message.points) > _MAX_POINTS:
        raise UnusableMessageError(SkipReason.TOO_MANY_POINTS)
    points = np.array([(p.x, p.y, p.z) for p in message.points], np.float32).reshape(-1, 3)
    offsets_s = np.array([p.offset_time for p in message.points], np.float64) * 1e-9
    usable = np.isfinite(points).all(axis=1) & points.any(axis=1)
    return PointCloud(
        stamp_ns, frame, readonly(points[usable], np.float32), readonly(offsets_s[usable], np.float32)
    )


def _column(message: Any, field: Any) -> NDArray[np.generic]:
    """One field of all points `(n,)`, rows' padding left out. Raises ValueError: the layout does not fit the data."""
    height, width = int(message.height), int(message.width)
    step, row_step, offset = int(message.point_step), int(message.row_step), int(field.offset)
    kind = np.dtype((">" if message.is_bigendian else "<") + _TYPES[int(field.datatype)])
    data = np.frombuffer(message.data, np.uint8)
    row_step = row_step if height > 1 else width * step
    if width and height and (offset + kind.itemsize > step or row_step < width * step):
        raise ValueError("a field outside its point")
    if (height - 1) * row_step + width * step > len(data):
        raise ValueError("fewer bytes than points")
    if not width * height:
        return np.zeros(0, kind)
    view = np.ndarray((height, width), kind, data, offset, (row_step, step))
    return view.reshape(-1)


def _offsets_s(message: Any, field: Any, stamp_ns: int) -> NDArray[np.float32]:
    """Times of the points `(n,)` after the header's stamp, s: by the standard, integers are nanoseconds and floats seconds.

    Drivers write other units, and stamps instead of offsets: the unit is the one that gives the time of a sweep.
    """
    values = _column(message, field)
    with np.errstate(invalid="ignore"):  # NaNs of damaged messages that a conversion warns about
        times = values.astype(np.float64)
    largest = float(np.max(np.abs(times[np.isfinite(times)]), initial=0.0))
    usual = 1e-9 if values.dtype.kind in "iu" else 1.0
    units = (usual, *(unit for unit in _UNITS_S if unit != usual))
    for unit in units:
        if largest * unit > _ABSOLUTE_FROM_S and abs(largest * unit - stamp_ns * 1e-9) < _MAX_DELAY_S:
            return np.asarray(times * unit - stamp_ns * 1e-9, np.float32)
    unit = next((u for u in units if _SWEEPS_S[0] <= largest * u < _SWEEPS_S[1]), usual)
    with np.errstate(over="ignore"):  # a time that is too large for a float32 is infinite
        return np.asarray(times * unit, np.float32)


def unusable_reason(cloud: PointCloud) -> SkipReason | None:
    """The reason why no method can use the cloud; None where it can."""
    if len(cloud.times_s) and not math.isfinite(float(cloud.times_s.sum(dtype=np.float64))):
        return SkipReason.NOT_FINITE
    return None


def to_ros(cloud: PointCloud, topic: str | None) -> list[Encoded]:
    """sensor_msgs/PointCloud2 with x, y, z and, where the cloud has them, times (s)."""
    names = ("x", "y", "z", "time")[: 4 if len(cloud.times_s) else 3]
    columns = [cloud.points_m, *([cloud.times_s[:, None]] if len(cloud.times_s) else [])]
    data = np.ascontiguousarray(np.hstack(columns), "<f4")
    body = with_header(cloud).uint32(1, len(data), len(names))
    for place, name in enumerate(names):
        body.text(name).uint32(4 * place).uint8(7).uint32(1)
    body.uint8(0).uint32(4 * len(names), 4 * len(names) * len(data))
    body.sequence(data.view(np.uint8).reshape(-1), 1).uint8(1)
    return single_message(topic or "/points", "sensor_msgs/msg/PointCloud2", cloud, body)
