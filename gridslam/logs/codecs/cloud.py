"""Codecs of point clouds: sensor_msgs/PointCloud2 with any layout of fields, and livox_ros_driver's CustomMsg."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import PointCloud, readonly
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head
from gridslam.logs.skips import SkipReason, UnusableMessageError

# sensor_msgs/PointField: datatype -> numpy's letter and size
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
# Names that drivers give to the time of a point (Ouster, Velodyne, Hesai and RoboSense, Livox), in order of precedence; any
# other name with one of these parts is taken as well.
_TIME_FIELDS = ("t", "time", "timestamp", "time_stamp", "offset_time", "time_offset", "ts", "dt")
_TIME_PARTS = ("time", "stamp")
# Largest difference between the stamp of a point and that of the header: beyond it they are from two clocks
_MAX_DELAY_S = 3.0
_MAX_OFFSET_S = 0.5  # largest offset of the first point: beyond it the offsets are from another clock
_UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
# Shortest and longest time that lidars take for a cloud; only one unit gives such a time
_SWEEPS_S = (0.003, 3.0)
_MIN_SWEEP_S = 5e-4  # shortest time of a part of a sweep, if the unit is the usual one
_SMALLEST_NUMBER = 1e-100  # smaller numbers of 64 bits are integers that a driver calls floats
_MAX_POINTS = 4_000_000


def from_ros(message: Any, topic: str) -> PointCloud:
    """The cloud in a sensor_msgs/PointCloud2, without points at the origin and points without finite coordinates."""
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
    points = points[usable]
    times, unit_s = _times(message, fields)
    is_return = points.any(axis=1)  # drivers write the origin for no return, and a meaningless time
    offsets = (
        _offsets_s(times[usable][is_return], unit_s, stamp_ns) if len(times) else np.zeros(0, np.float32)
    )
    if len(offsets) and len(offsets) < len(points):
        filled = np.zeros(len(points), np.float32)
        filled[is_return] = offsets
        offsets = filled
    return PointCloud(stamp_ns, frame, readonly(points, np.float32), readonly(offsets, np.float32))


def from_livox(message: Any, topic: str) -> PointCloud:
    """The cloud in a livox_ros_driver(2)/CustomMsg, without points at the origin, which are not returns."""
    stamp_ns, frame = valid_head(message)
    if len(message.points) > _MAX_POINTS:
        raise UnusableMessageError(SkipReason.TOO_MANY_POINTS)
    points = readonly([(p.x, p.y, p.z) for p in message.points], np.float32).reshape(-1, 3)
    offsets_s = np.array([p.offset_time for p in message.points], np.float64) * 1e-9
    usable = np.isfinite(points).all(axis=1) & points.any(axis=1)
    return PointCloud(
        stamp_ns, frame, readonly(points[usable], np.float32), readonly(offsets_s[usable], np.float32)
    )


def _column(message: Any, field: Any) -> NDArray[np.generic]:
    """One field of all points `(n,)`; padding of rows is skipped. Raises ValueError: the layout does not fit the data."""
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


def _times(message: Any, fields: Mapping[str, Any]) -> tuple[NDArray[np.float64], float]:
    """The times of the points `(n,)` as recorded, empty if there are none, and their usual unit in seconds.

    Integers are nanoseconds, and floats seconds; two fields may hold the seconds and the nanoseconds.
    """
    for name in fields:
        seconds = name.removesuffix("nsec") + "sec", name.removesuffix("Nsec") + "Sec"
        if whole := next((fields[s] for s in seconds if s != name and s in fields), None):
            parts = (_column(message, field).astype(np.float64) for field in (whole, fields[name]))
            return next(parts) + 1e-9 * next(parts), 1.0
    other = (name for name in fields if any(part in name.lower() for part in _TIME_PARTS))
    field = next((fields[name] for name in (*_TIME_FIELDS, *other) if name in fields), None)
    if field is None or int(field.datatype) not in _TYPES:
        return np.zeros(0), 1.0
    values = _column(message, field)
    if values.dtype.itemsize == 8 and np.any(values) and np.max(np.abs(values)) < _SMALLEST_NUMBER:
        values = np.ascontiguousarray(values).view(values.dtype.str.replace("f", "u"))
    with np.errstate(invalid="ignore"):  # NaNs of damaged messages that a conversion warns about
        return values.astype(np.float64), 1e-9 if values.dtype.kind in "iu" else 1.0


def _offsets_s(times: NDArray[np.float64], usual: float, stamp_ns: int) -> NDArray[np.float32]:
    """Times of the points `(n,)` after the header's stamp (s), given their times in a unit that is perhaps the `usual` one (s).

    Drivers write other units, or stamps (perhaps from another clock) instead of offsets. The unit is taken with which the times
    last as long as a sweep; if there is none, the result is empty.
    """
    known = times[np.isfinite(times)]
    if len(known) < len(times):  # no method can use the cloud
        return np.asarray(times, np.float32)
    first, last = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    sweep = last - first
    others = (unit for unit in _UNITS_S if unit != usual and _SWEEPS_S[0] <= sweep * unit < _SWEEPS_S[1])
    unit = usual if _MIN_SWEEP_S <= sweep * usual < _SWEEPS_S[1] else next(others, None)
    if unit is None:
        return np.zeros(0, np.float32)
    if abs(first * unit - stamp_ns * 1e-9) < _MAX_DELAY_S and first * unit > _MAX_OFFSET_S:
        return np.asarray(times * unit - stamp_ns * 1e-9, np.float32)
    is_offset = abs(first) * unit <= max(_MAX_OFFSET_S, sweep * unit)
    return np.asarray((times if is_offset else times - first) * unit, np.float32)


def unusable_reason(cloud: PointCloud) -> SkipReason | None:
    """The reason why no method can use the cloud; None if it can."""
    if len(cloud.times_s) and not math.isfinite(float(cloud.times_s.sum(dtype=np.float64))):
        return SkipReason.NOT_FINITE
    return None


def to_ros(cloud: PointCloud, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/PointCloud2 with x, y, z and, if the cloud has them, times (s)."""
    names = ("x", "y", "z", "time")[: 4 if len(cloud.times_s) else 3]
    columns = [cloud.points_m, *([cloud.times_s[:, None]] if len(cloud.times_s) else [])]
    data = np.ascontiguousarray(np.hstack(columns), "<f4")
    body = with_header(cloud).uint32(1, len(data), len(names))
    for column, name in enumerate(names):
        body.text(name).uint32(4 * column).uint8(7).uint32(1)
    body.uint8(0).uint32(4 * len(names), 4 * len(names) * len(data))
    body.sequence(data.view(np.uint8).reshape(-1), 1).uint8(1)
    return single_message(topic or "/points", "sensor_msgs/msg/PointCloud2", cloud, body)
