"""The fields of CARMEN lines.

    FLASER n r1..rn x y theta odom_x odom_y odom_theta ipc_timestamp host logger_timestamp
    ROBOTLASER1 type start_angle field_of_view resolution max_range accuracy remission_mode n r.. m rem..
                laser(x y theta) robot(x y theta) tv rv forward side turn ipc_timestamp host logger_timestamp
    RAWLASER1 the same up to the remissions, then ipc_timestamp host logger_timestamp: no poses
    ODOM x y theta tv rv accel ipc_timestamp host logger_timestamp

Lengths are in m, angles in rad, velocities (tv, rv) in m/s and rad/s. The stamp of a message is ipc_timestamp. Fields behind the
readings are addressed from the end of the line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Odometry, canonical_yaw, readonly
from gridslam.core.stamps import parse_stamp
from gridslam.core.texts import parse_numbers
from gridslam.logs.carmen.decimals import parse_decimals
from gridslam.logs.skips import SkipReason

# First word of a laser line -> the laser's frame. FLASER is the front laser of old logs, ROBOTLASER1 that of newer ones.
LASERS = {
    b"FLASER": "laser",
    b"RLASER": "rear_laser",
    b"RAWLASER1": "laser",
    b"RAWLASER2": "rear_laser",
    b"ROBOTLASER0": "laser0",
    b"ROBOTLASER1": "laser",
    b"ROBOTLASER2": "rear_laser",
    **{b"LASER%d" % n: f"laser{n}" for n in range(3, 6)},
}
OTHER_MESSAGES = frozenset({b"ODOM", b"PARAM", b"SYNC", b"TRUEPOS"})
_MAX_COUNT_DIGITS = 6
_POSES = 6  # numbers of the laser's pose and the robot's
_MOTION = 5  # numbers tv rv forward side turn
_STAMPS = 3  # words ipc_timestamp host logger_timestamp
_STAMP = -3  # place of ipc_timestamp
ODOM_WORDS = 10


@dataclass(frozen=True, slots=True)
class LaserLine:
    """The fields of one laser line.

    `ranges` (m) are `(n,)`. `laser_pose` and `robot_pose` are (x, y, yaw) (m, rad) in the odometry frame, `velocity` is (forward
    speed in m/s, yaw rate in rad/s). In RAWLASER lines `robot_pose` is None, and `laser_pose` and `velocity` are zero.
    `geometry` is (angle_min in rad, increment in rad, range_max in m). FLASER lines have neither velocity nor geometry.
    """

    stamp_ns: int
    ranges: NDArray[np.float32]
    laser_pose: tuple[float, float, float]
    robot_pose: tuple[float, float, float] | None
    velocity: tuple[float, float] | None = None
    geometry: tuple[float, float, float] | None = None


def looks_like_carmen(text: bytes) -> bool:
    """Whether one of the lines starts with the name of a CARMEN message."""
    return any(
        words[0] in LASERS or words[0] in OTHER_MESSAGES
        for words in (line.split(None, 2) for line in text.splitlines())
        if len(words) > 2
    )


def beam_angles(count: int, field_of_view_deg: float | None = None) -> tuple[float, float]:
    """Angle of the first beam, and increment (rad), of `count` beams.

    `field_of_view_deg` is the angle from the first to the last beam. Without it, the laser is a SICK that covers -90 to 90
    degrees: 181 beams at 1 degree, or 361 at 0.5 degrees. Of 180 or 360 beams the last one is missing: they end at 89 or 89.5.
    """
    if field_of_view_deg is not None:
        increment = math.radians(field_of_view_deg) / max(count - 1, 1)
        return -0.5 * math.radians(field_of_view_deg), increment
    intervals = count - 1 if count % 2 else count
    return -0.5 * math.pi, math.pi / max(intervals, 1)


def old_laser_lines(lines: Sequence[bytes]) -> list[LaserLine | None]:
    """The fields of FLASER lines (or others of the same form), parsed together: ten times as fast as one by one.

    None for a line that cannot be parsed in this way, because it is damaged or has its fields separated by more than a space:
    parse it with `laser_line`. If one of the numbers is not a decimal, this holds for all lines.
    """
    rows: list[tuple[int, _Numbers]] = []
    for i, line in enumerate(lines):
        if (numbers := _numbers_of(line)) is not None:
            rows.append((i, numbers))
    parsed: list[LaserLine | None] = [None] * len(lines)
    try:
        values = parse_decimals(b" ".join([row.text for _, row in rows])) if rows else np.zeros(0)
    except ValueError:
        return parsed
    readings = readonly(values, np.float32)
    end = 0
    for i, row in rows:
        start, end = end, end + row.beams + _POSES
        poses = values[end - _POSES : end].tolist()
        if row.stamp_ns is not None and math.isfinite(sum(poses)):
            ranges = readings[start : end - _POSES]
            parsed[i] = LaserLine(row.stamp_ns, ranges, tuple(poses[:3]), tuple(poses[3:]))
    return parsed


class _Numbers(NamedTuple):
    """The parts of an FLASER line; `text` holds its ranges and poses. `stamp_ns` is None if the stamp is invalid."""

    beams: int
    stamp_ns: int | None
    text: bytes


def _numbers_of(line: bytes) -> _Numbers | None:
    """The parts of an FLASER line; None if its fields are not separated by single spaces, or their number is wrong."""
    head, tail = line.split(b" ", 2), line.rsplit(b" ", _STAMPS)
    if (
        len(head) != 3
        or len(tail) != 1 + _STAMPS
        or not head[1].isdigit()
        or len(head[1]) > _MAX_COUNT_DIGITS
    ):
        return None
    beams = int(head[1])
    text = tail[0][len(head[0]) + len(head[1]) + 2 :]
    if text.count(b" ") != beams + _POSES - 1 or b"  " in text or b"\t" in line:
        return None
    return _Numbers(beams, parse_stamp(tail[_STAMP].decode("ascii", "replace")), text)


def laser_line(word: bytes, line: bytes) -> LaserLine | SkipReason:
    """The fields of a laser line whose first word is `word`, or the reason why it cannot be used."""
    words = line.split()
    try:
        if word.startswith((b"ROBOTLASER", b"RAWLASER")):
            return _robot_laser(words, has_poses=word.startswith(b"ROBOT"))
        return _old_laser(words)
    except (ValueError, IndexError):
        return SkipReason.UNREADABLE_LINE


def _old_laser(words: list[bytes]) -> LaserLine | SkipReason:
    """The fields of an FLASER line. Raises ValueError or IndexError: it is damaged."""
    beams = _count(words[1])
    first = 2  # place of the first range
    if beams < 0 or len(words) != first + beams + _POSES + _STAMPS:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[_STAMP].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    poses = parse_numbers(words[first + beams : -_STAMPS])
    if not math.isfinite(sum(poses)):
        return SkipReason.NOT_FINITE
    ranges = readonly(parse_numbers(words[first : first + beams]), np.float32)
    return LaserLine(stamp, ranges, (poses[0], poses[1], poses[2]), (poses[3], poses[4], poses[5]))


def _robot_laser(words: list[bytes], has_poses: bool) -> LaserLine | SkipReason:
    """The fields of a ROBOTLASER line or, without poses, of a RAWLASER line. Raises ValueError or IndexError: it is damaged."""
    beams = _count(words[8])
    first = 9  # place of the first range
    if beams < 0 or len(words) < first + beams + 1:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    remissions = _count(words[first + beams])
    motion = _POSES + _MOTION if has_poses else 0
    if remissions < 0 or len(words) != first + beams + 1 + remissions + motion + _STAMPS:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[_STAMP].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    start, width, resolution, range_max = parse_numbers(words[2:6])
    ranges = readonly(parse_numbers(words[first : first + beams]), np.float32)
    tail = parse_numbers(words[-motion - _STAMPS : -_STAMPS]) if has_poses else [0.0] * (_POSES + _MOTION)
    if not math.isfinite(sum(tail)):
        return SkipReason.NOT_FINITE
    return LaserLine(
        stamp,
        ranges,
        laser_pose=(tail[0], tail[1], tail[2]),
        robot_pose=(tail[3], tail[4], tail[5]) if has_poses else None,
        velocity=(tail[6], tail[7]),
        geometry=(start, resolution or width / max(beams - 1, 1), range_max),
    )


def _count(word: bytes) -> int:
    """A number of beams; a damaged line can state a negative one. Raises ValueError: the word is not an integer."""
    if len(word) > _MAX_COUNT_DIGITS or not (word.isdigit() or word.removeprefix(b"-").isdigit()):
        raise ValueError(f"{word!r} is not a count")
    return int(word)


def odom_stamps(lines: Sequence[bytes]) -> list[int | SkipReason]:
    """Stamp (ns) of each ODOM line, or the reason to skip it: as from `odom_line`, but parsed together, which is faster."""
    split = [line.split() for line in lines]
    used = [words for words in split if len(words) == ODOM_WORDS]
    try:
        parse_decimals(b" ".join([word for words in used for word in words[1:6]]) if used else b"0")
    except ValueError:
        used = []
    if len(used) < len(lines):  # a line is damaged or has an unusual form
        read = [odom_line(line) for line in lines]
        return [found.stamp_ns if isinstance(found, Odometry) else found for found in read]
    stamps = [parse_stamp(words[_STAMP].decode("ascii", "replace")) for words in used]
    return [SkipReason.BAD_STAMP if stamp is None else stamp for stamp in stamps]


def odom_line(line: bytes) -> Odometry | SkipReason:
    """The odometry of an ODOM line, or the reason why the line cannot be used."""
    words = line.split()
    if len(words) != ODOM_WORDS:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[_STAMP].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    try:
        x, y, yaw, vx, wz = parse_numbers(words[1:6])
    except ValueError:
        return SkipReason.UNREADABLE_LINE
    return Odometry(stamp, "odom", x_m=x, y_m=y, yaw_rad=_yaw(yaw), vx_mps=vx, wz_radps=wz)


def odometry_in(laser: LaserLine) -> Odometry:
    """The odometry in a laser line; NaN for values that the line does not have."""
    x, y, yaw = laser.robot_pose or (math.nan,) * 3
    vx, wz = laser.velocity or (math.nan, math.nan)
    return Odometry(laser.stamp_ns, "odom", x_m=x, y_m=y, yaw_rad=_yaw(yaw), vx_mps=vx, wz_radps=wz)


def _yaw(yaw: float) -> float:
    """The yaw in (-pi, pi], rounded so that every log format stores it exactly; unchanged if it is not finite."""
    return canonical_yaw(math.atan2(math.sin(yaw), math.cos(yaw))) if math.isfinite(yaw) else yaw
