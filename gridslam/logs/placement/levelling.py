"""Scans of a robot that rolls and pitches: each is placed by the tilt that the IMU had at its stamp."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import Imu, LaserScan, Odometry, Transform, readonly
from gridslam.logs import rotations
from gridslam.logs.codecs import odometry as odometry_codec
from gridslam.logs.config import LogConfig
from gridslam.logs.imu.lag import imu_lag_s
from gridslam.logs.imu.readings import MAX_GAP_S, ImuReadings, OdometryReference
from gridslam.logs.imu.tilt import (
    UntrustedImuError,
    Verticals,
    verticals_of,
)
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.placement import extrinsics
from gridslam.logs.rotations import Quaternion, Rigid
from gridslam.logs.selection import StreamSelection
from gridslam.logs.streams import Source

Floats = NDArray[np.float64]

PROBED_READINGS = 200  # an IMU that measured no orientation and no acceleration in these has none
# Fractions of the scans that have a reading: below the first none is levelled, below the second a note says so.
MIN_COVERED, FULLY_COVERED = 0.1, 0.95
MIN_SPACING_NS = 5_000_000  # smallest time between readings that are kept: robots tilt slowly
MIN_FIXED_TILT_RAD = math.radians(1.0)  # a lidar that is mounted with a smaller tilt counts as level
MIN_KNOWN_HEIGHT_M = 0.1  # a lidar that is lower has no height, or its base is not on the floor
# Beams that end below these heights have met the floor, those above the headroom a ceiling.
GROUND_M, HALF_BAND_M, HEADROOM_M = 0.2, 0.3, 1.2


@dataclass(frozen=True, slots=True)
class Tilt:
    """The unit vector upward `(n, 3)` in the base frame at `stamps_ns` int64 `(n,)`, ascending."""

    stamps_ns: NDArray[np.int64]
    up: Floats

    def at(self, stamp_ns: int) -> Quaternion:
        """T_level_base at a stamp, with x of the level frame below x of the base; the identity far from the readings."""
        after = int(np.searchsorted(self.stamps_ns, stamp_ns))
        before = max(after - 1, 0)
        after = min(after, len(self.stamps_ns) - 1)
        since_s, until_s = (abs(int(self.stamps_ns[k]) - stamp_ns) * 1e-9 for k in (before, after))
        if min(since_s, until_s) > MAX_GAP_S:
            return rotations.IDENTITY[1]
        fraction = since_s / (since_s + until_s) if since_s + until_s > 0.0 else 0.0
        x, y, z = (self.up[before] + fraction * (self.up[after] - self.up[before])).tolist()
        return rotations.from_euler(np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z)), 0.0)


def find_tilt(
    source: Source,
    selection: StreamSelection,
    config: LogConfig,
    tree: extrinsics.Tree,
    message_counts: MessageCounts,
) -> Tilt | None:
    """The robot's tilt by the first IMU that can be trusted; None if the robot stays level, or no IMU measures its tilt."""
    imus = _imus(source, config)
    if not imus:
        return None
    readings, odometry = _read(source, imus, [i for i, kind in selection.kind_of.items() if kind == "odom"])
    for index, of_imu in readings.items():
        stream = source.streams[index]
        frame = next(iter(stream.frames), selection.base_frame)
        given = _extrinsics_of(frame, tree, config, selection.base_frame)
        R_base_imu = rotation_matrix((given or rotations.IDENTITY)[1])
        lag_s = imu_lag_s(of_imu, R_base_imu, odometry)
        if lag_s:
            of_imu = replace(of_imu, stamps_ns=of_imu.stamps_ns - round(lag_s * 1e9))
        try:
            found = verticals_of(of_imu, R_base_imu, odometry)
        except UntrustedImuError as error:
            if str(error):
                message_counts.find(f"{stream.label}: not used to level the scans: {error}")
            continue
        if found.is_level:
            return None
        if lag_s:
            message_counts.find(
                f"{stream.label}: by the odometry's turns its stamps are {abs(lag_s):.2f} s "
                f"{'late' if lag_s > 0.0 else 'early'}: undone where it levels the scans"
            )
        covered = _covered(source, selection, found)
        if covered < MIN_COVERED:
            message_counts.note(
                f"{stream.label}: its readings cover {covered:.0%} of the scans, which are not levelled"
            )
            continue
        line = _used(stream.label, found, frame if given is None else None)
        partly = f"; its readings cover {covered:.0%} of the scans, and the others are not levelled"
        message_counts.note(line + partly * (covered < FULLY_COVERED))
        return Tilt(found.stamps_ns, found.up)
    return None


def _covered(source: Source, selection: StreamSelection, found: Verticals) -> float:
    """The fraction of the scans that have a reading within MAX_GAP_S."""
    scans = [source.streams[i].stamps_ns for i, kind in selection.kind_of.items() if kind == "scan"]
    stamps_ns = np.concatenate([np.asarray(one, np.int64) for one in scans])
    after = np.clip(np.searchsorted(found.stamps_ns, stamps_ns), 1, len(found.stamps_ns) - 1)
    apart = np.minimum(*(np.abs(found.stamps_ns[k] - stamps_ns) for k in (after - 1, after)))
    return float((apart <= MAX_GAP_S * 1e9).mean()) if len(stamps_ns) else 0.0


@dataclass(frozen=True, slots=True)
class LevelBand:
    """Heights (m) above the base between which a beam of a tilted planar lidar has met a wall, not the floor or the ceiling."""

    min_m: float
    max_m: float

    @classmethod
    def of_lidar(cls, height_m: float) -> LevelBand:
        """The band for a lidar at this height above the base. The base is taken to be on the floor if the lidar is above it."""
        if height_m < MIN_KNOWN_HEIGHT_M:
            return cls(height_m - HALF_BAND_M, height_m + HEADROOM_M)
        return cls(min(0.5 * height_m, GROUND_M), height_m + HEADROOM_M)


def level_scan(scan: LaserScan, T_level_sensor: Rigid, band: LevelBand) -> LaserScan:
    """The scan with NaN for readings that end outside the band; the same object if there are none."""
    _, _, axis_z = rotation_matrix(T_level_sensor[1])
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
    rise = axis_z[0] * np.cos(angles) + axis_z[1] * np.sin(angles)
    with np.errstate(invalid="ignore"):
        height = T_level_sensor[0][2] + scan.ranges_m * rise
        is_outside = (height < band.min_m) | (height > band.max_m)
        is_outside &= scan.ranges_m < (scan.range_max_m or np.inf)
    if not is_outside.any():
        return scan
    return replace(scan, ranges_m=readonly(np.where(is_outside, np.nan, scan.ranges_m), np.float32))


def fixed_tilt_rad(T_base_sensor: Rigid) -> float:
    """Angle between a lidar's plane and that of a base that stays level; 0 where it is small, or the lidar's height unknown."""
    _, _, (x, y, _) = rotation_matrix(T_base_sensor[1])
    angle_rad = math.asin(min(math.hypot(x, y), 1.0))
    return angle_rad if angle_rad >= MIN_FIXED_TILT_RAD and T_base_sensor[0][2] >= MIN_KNOWN_HEIGHT_M else 0.0


def without_floor(scan: LaserScan, T_base_sensor: Rigid) -> LaserScan:
    """The scan of a lidar on a level base, without the floor and ceiling that it sees because of its fixed tilt."""
    if not fixed_tilt_rad(T_base_sensor):
        return scan
    return level_scan(scan, T_base_sensor, LevelBand.of_lidar(T_base_sensor[0][2]))


def middle_ns(scan: LaserScan) -> int:
    """The stamp of a scan's middle beam."""
    return scan.stamp_ns + round(0.5e9 * scan.time_increment_s * (len(scan.ranges_m) - 1))


def _imus(source: Source, config: LogConfig) -> list[int]:
    """The IMU streams, those with most readings first; the ones that the config names, if it names any."""
    named = config.topics.get("imu")
    names = [named] if isinstance(named, str) else named
    found = [
        i
        for i, stream in enumerate(source.streams)
        if stream.kind == "imu"
        and len(stream.stamps_ns)
        and (names is None or {stream.topic, stream.label} & set(names))
    ]
    return sorted(found, key=lambda i: -len(source.streams[i].stamps_ns))


def _read(
    source: Source, imus: Sequence[int], odometry: Sequence[int]
) -> tuple[dict[int, ImuReadings], OdometryReference | None]:
    """The readings of each IMU that measures more than turn rates, and the odometry's headings, in a pass of its own."""
    stamps = {i: array("q") for i in imus}
    values = {i: array("d") for i in imus}
    yaw_stamps, yaws, positions = array("q"), array("d"), array("d")
    wanted = frozenset([*imus, *odometry])
    schedule = [i for i in sorted(wanted) for _ in source.streams[i].stamps_ns]
    restamped = {i: iter(source.streams[i].stamps_ns) for i in wanted}
    probed, measures = 0, False
    for index, event in source.read(wanted, schedule):
        stamp_ns = next(restamped[index], None)
        if stamp_ns is None:
            continue
        if isinstance(event, Imu):
            probed += 1
            measures |= event.quat_wxyz is not None or event.accel_mps2 is not None
            if not measures and probed >= PROBED_READINGS:
                return {}, None
            if not stamps[index] or stamp_ns - stamps[index][-1] >= MIN_SPACING_NS:
                stamps[index].append(stamp_ns)
                values[index].extend(_row(event))
        elif isinstance(event, Odometry | Transform):
            pose = odometry_codec.from_transform(event) if isinstance(event, Transform) else event
            if np.isfinite(pose.yaw_rad) and (not yaw_stamps or stamp_ns > yaw_stamps[-1]):
                yaw_stamps.append(stamp_ns)
                yaws.append(pose.yaw_rad)
                positions.extend((pose.x_m, pose.y_m))
    found = {i: _readings(stamps[i], values[i]) for i in imus if measures and len(stamps[i]) > 2}
    path = np.array(positions).reshape(-1, 2)
    return found, OdometryReference(np.array(yaw_stamps, np.int64), np.array(yaws), path) if yaws else None


def _row(imu: Imu) -> list[float]:
    nan = float("nan")
    rates = (imu.wx_radps, imu.wy_radps, imu.wz_radps)
    return [*(imu.quat_wxyz or (nan,) * 4), *rates, *(imu.accel_mps2 or (nan,) * 3)]


def _readings(stamps: array[int], values: array[float]) -> ImuReadings:
    table = np.array(values).reshape(len(stamps), -1)
    return ImuReadings(np.array(stamps, np.int64), table[:, :4], np.nan_to_num(table[:, 4:7]), table[:, 7:])


def _extrinsics_of(frame: str, tree: extrinsics.Tree, config: LogConfig, base: str) -> Rigid | None:
    """T_base_imu; None if the log does not state it."""
    if frame in config.extrinsics:
        m = config.extrinsics[frame]
        return (m.x, m.y, m.z), rotations.from_euler(m.roll, m.pitch, m.yaw)
    of_base, of_imu = extrinsics.ancestors(tree, base), extrinsics.ancestors(tree, frame)
    common = next((name for name in of_imu if name in of_base), None)
    if common is None:
        return None
    return rotations.compose(rotations.inverse(of_base[common]), of_imu[common])


def _used(label: str, found: Verticals, unplaced: str | None) -> str:
    """One line for the user."""
    how = "its accelerations and turn rates" if found.by_gravity else "its orientation"
    line = (
        f"{label}: scans are levelled by {how}: the robot tilts by up to {np.degrees(found.sway_rad):.1f} deg"
    )
    if unplaced is not None:
        line += f"; no transform to {unplaced}: taken as x forward, z up, else set log.extrinsics.{unplaced}"
    return "; ".join([line, *found.remarks])
