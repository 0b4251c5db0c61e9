"""The fields of CARMEN lines.

    FLASER n r1..rn x y theta odom_x odom_y odom_theta ipc_timestamp host logger_timestamp
    ROBOTLASER1 type start_angle field_of_view resolution max_range accuracy remission_mode n r.. m rem..
                laser(x y theta) robot(x y theta) tv rv forward side turn ipc_timestamp host logger_timestamp
    RAWLASER1 the same up to the remissions, then ipc_timestamp host logger_timestamp: no poses
    ODOM x y theta tv rv accel ipc_timestamp host logger_timestamp

The tail is counted from the end; the time is ipc_timestamp.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Odometry, canonical_yaw, readonly
from gridslam.core.stamps import parse_stamp
from gridslam.core.texts import parse_numbers
from gridslam.logs.carmen.decimals import parse_decimals
from gridslam.logs.skips import SkipReason

# Message: the laser's frame. FLASER is the front laser of old logs, ROBOTLASER1 of newer ones.
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
OTHERS = frozenset({b"ODOM", b"PARAM", b"SYNC", b"TRUEPOS"})
_TAIL = 6  # numbers behind the ranges of an old laser line: the laser's pose and the robot's
_MAX_COUNT_DIGITS = 6
ODOM_WORDS = 10


@dataclass(frozen=True, slots=True)
class LaserLine:
    """The fields of one laser line. `geometry` is (angle_min, increment, range_max) where the line has them.

    `robot_pose` is None in lines without poses.
    """

    stamp_ns: int
    ranges: NDArray[np.float32]
    laser_pose: tuple[float, float, float]
    robot_pose: tuple[float, float, float] | None
    velocity: tuple[float, float] | None = None
    geometry: tuple[float, float, float] | None = None


def looks_like_carmen(text: bytes) -> bool:
    """Whether the first lines hold a laser or odometry message."""
    return any(
        words[0] in LASERS or words[0] in OTHERS
        for words in (line.split(None, 2) for line in text.splitlines())
        if len(words) > 2
    )


def beam_angles(count: int, field_of_view_deg: float | None = None) -> tuple[float, float]:
    """(angle_min, increment) in rad of `count` beams.

    The SICK lasers of these logs look 180 degrees wide: 181 beams at 1 and 361 at 0.5 degrees reach both
    ends; 180 and 360 lack the last one (-90..+89 and -90..+89.5). A given field of view is that from the
    first to the last beam.
    """
    if field_of_view_deg is not None:
        increment = math.radians(field_of_view_deg) / max(count - 1, 1)
        return -0.5 * math.radians(field_of_view_deg), increment
    intervals = count - 1 if count % 2 else count
    return -0.5 * math.pi, math.pi / max(intervals, 1)


def old_laser_lines(lines: Sequence[bytes]) -> list[LaserLine | None]:
    """The fields of FLASER lines (or others of the same form), parsed together: ten times as fast as one by one.

    None for a line that is not in the usual form, single spaces and all: `laser_line` says more about it.
    """
    counts: list[int] = []
    stamps: list[int | None] = []
    numbers: list[bytes] = []
    for line in lines:
        count, stamp, middle = _ends_of(line)
        counts.append(count)
        stamps.append(stamp)
        numbers.append(middle)
    used = [i for i, count in enumerate(counts) if count >= 0]
    try:
        values = parse_decimals(b" ".join([numbers[i] for i in used])) if used else np.zeros(0)
    except ValueError:
        return [None] * len(lines)
    readings = readonly(values, np.float32)
    taken: list[LaserLine | None] = [None] * len(lines)
    end = 0
    for i in used:
        start, end = end, end + counts[i] + _TAIL
        stamp = stamps[i]
        tail = values[end - _TAIL : end].tolist()
        if stamp is not None and math.isfinite(sum(tail)):
            ranges = readings[start : end - _TAIL]
            taken[i] = LaserLine(stamp, ranges, tuple(tail[:3]), tuple(tail[3:]))
    return taken


def _ends_of(line: bytes) -> tuple[int, int | None, bytes]:
    """The beam count, the stamp and the numbers in between of a line; a count of -1 where its form is not the usual one."""
    head, tail = line.split(b" ", 2), line.rsplit(b" ", 3)
    if len(head) != 3 or len(tail) != 4 or not head[1].isdigit() or len(head[1]) > _MAX_COUNT_DIGITS:
        return -1, None, b""
    count = int(head[1])
    middle = tail[0][len(head[0]) + len(head[1]) + 2 :]
    if middle.count(b" ") != count + _TAIL - 1 or b"  " in middle or b"\t" in line:
        return -1, None, b""
    return count, parse_stamp(tail[1].decode("ascii", "replace")), middle


def laser_line(word: bytes, line: bytes) -> LaserLine | SkipReason:
    """The fields of a laser line, or the reason why it cannot be used."""
    words = line.split()
    try:
        if word.startswith((b"ROBOTLASER", b"RAWLASER")):
            return _robot_laser(words, has_poses=word.startswith(b"ROBOT"))
        return _old_laser(words)
    except (ValueError, IndexError):
        return SkipReason.UNREADABLE_LINE


def _old_laser(words: list[bytes]) -> LaserLine | SkipReason:
    count = _count(words[1])
    if count < 0 or len(words) != count + 11:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[-3].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    tail = parse_numbers(words[count + 2 : count + 8])
    if not math.isfinite(sum(tail)):
        return SkipReason.NOT_FINITE
    ranges = readonly(parse_numbers(words[2 : count + 2]), np.float32)
    return LaserLine(stamp, ranges, (tail[0], tail[1], tail[2]), (tail[3], tail[4], tail[5]))


def _robot_laser(words: list[bytes], has_poses: bool) -> LaserLine | SkipReason:
    count = _count(words[8])
    if count < 0 or len(words) < count + 10:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    remissions = _count(words[count + 9])
    if remissions < 0 or len(words) != count + remissions + (24 if has_poses else 13):
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[-3].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    start, width, resolution, range_max = parse_numbers(words[2:6])
    ranges = readonly(parse_numbers(words[9 : count + 9]), np.float32)
    tail = parse_numbers(words[-14:-3]) if has_poses else [0.0] * 11
    if not math.isfinite(sum(tail)):
        return SkipReason.NOT_FINITE
    return LaserLine(
        stamp,
        ranges,
        laser_pose=(tail[0], tail[1], tail[2]),
        robot_pose=(tail[3], tail[4], tail[5]) if has_poses else None,
        velocity=(tail[6], tail[7]),
        geometry=(start, resolution or width / max(count - 1, 1), range_max),
    )


def _count(word: bytes) -> int:
    """A number of beams. Raises ValueError: the word is none."""
    if len(word) > _MAX_COUNT_DIGITS or not (word.isdigit() or word.removeprefix(b"-").isdigit()):
        raise ValueError(f"{word!r} is no count")
    return int(word)


def odom_stamps(lines: Sequence[bytes]) -> list[int | SkipReason]:
    """Stamp (ns) of each ODOM line, or the reason to skip it; as `odom_line`, but for many lines at once."""
    split = [line.split() for line in lines]
    used = [words for words in split if len(words) == ODOM_WORDS]
    try:
        parse_decimals(b" ".join([word for words in used for word in words[1:6]]) if used else b"0")
    except ValueError:
        used = []
    if len(used) < len(lines):  # one of them is odd
        read = [odom_line(line) for line in lines]
        return [found.stamp_ns if isinstance(found, Odometry) else found for found in read]
    stamps = [parse_stamp(words[7].decode("ascii", "replace")) for words in used]
    return [SkipReason.BAD_STAMP if stamp is None else stamp for stamp in stamps]


def odom_line(line: bytes) -> Odometry | SkipReason:
    """The odometry of an ODOM line, or the reason why the line cannot be used."""
    words = line.split()
    if len(words) != ODOM_WORDS:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[7].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    try:
        x, y, yaw, vx, wz = parse_numbers(words[1:6])
    except ValueError:
        return SkipReason.UNREADABLE_LINE
    return Odometry(stamp, "odom", x_m=x, y_m=y, yaw_rad=_yaw(yaw), vx_mps=vx, wz_radps=wz)


def odometry_in(laser: LaserLine) -> Odometry:
    """The odometry that a ROBOTLASER line carries; NaN for values that the line lacks."""
    x, y, yaw = laser.robot_pose or (math.nan,) * 3
    vx, wz = laser.velocity or (math.nan, math.nan)
    return Odometry(laser.stamp_ns, "odom", x_m=x, y_m=y, yaw_rad=_yaw(yaw), vx_mps=vx, wz_radps=wz)


def _yaw(yaw: float) -> float:
    """The yaw, canonical and in (-pi, pi], which every format keeps exactly."""
    return canonical_yaw(math.atan2(math.sin(yaw), math.cos(yaw))) if math.isfinite(yaw) else yaw
