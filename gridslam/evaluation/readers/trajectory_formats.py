"""Readers of trajectory files: TUM, planar text, KITTI, EuRoC, and CSV with a header; recognised by content.

| format | lines |
|---|---|
| TUM | `t x y z qx qy qz qw` |
| planar | `t x y yaw` |
| KITTI | the 12 numbers of a 3 x 4 matrix, row by row, without stamps |
| EuRoC | `stamp in ns, x, y, z, qw, qx, qy, qz[, ...]` |
| CSV | a header with names of columns |
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import InputError
from gridslam.core.stamps import NS_PER_S, parse_stamp
from gridslam.core.texts import parse_number
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.logs.tum import lines_of, numbers_in, stamp_in

TUM_WORDS, PLANAR_WORDS, KITTI_WORDS, EUROC_WORDS = 8, 4, 12, 8
MIN_NS_DIGITS, MIN_US_DIGITS = 18, 15  # an integer stamp with fewer digits has a larger unit
EXPECTED = "t x y z qx qy qz qw (TUM), t x y yaw, KITTI's 12 numbers, EuRoC's stamp x y z qw qx qy qz, or a CSV header"
CAMERA_NOTE = "the poses are in a camera frame (x right, y down, z forward): x = z and y = -x were taken"
# Names of CSV columns in lower case; of dotted names the last parts count (`pose.pose.position.x`).
COLUMN_NAMES = {
    "stamp": (
        "stamp",
        "header.stamp",
        "timestamp",
        "time",
        "t",
        "sec",
        "secs",
        "seconds",
        "stamp.sec",
        "stamp.secs",
    ),
    "nanoseconds": ("nsecs", "nsec", "nanosec", "nanosecs", "nanoseconds"),
    "x": ("x", "position.x", "pos_x", "px", "tx", "p_x", "p_rs_r_x"),
    "y": ("y", "position.y", "pos_y", "py", "ty", "p_y", "p_rs_r_y"),
    "z": ("z", "position.z", "pos_z", "pz", "tz", "p_z", "p_rs_r_z"),
    "yaw": ("yaw", "theta", "heading", "yaw_rad"),
    "yaw_deg": ("yaw_deg", "theta_deg", "heading_deg"),
    "qw": ("qw", "orientation.w", "q_w", "rot_w", "q_rs_w"),
    "qx": ("qx", "orientation.x", "q_x", "rot_x", "q_rs_x"),
    "qy": ("qy", "orientation.y", "q_y", "rot_y", "q_rs_y"),
    "qz": ("qz", "orientation.z", "q_z", "rot_z", "q_rs_z"),
}
QUATERNION = ("qw", "qx", "qy", "qz")
# Smallest number of digits of a whole number, and its unit
_UNIT_OF_DIGITS = ((MIN_NS_DIGITS, "ns"), (MIN_US_DIGITS, "us"), (12, "ms"), (0, "s"))


def read_poses(path: Path) -> PoseSeries:
    """The poses of a trajectory file in the file's order. Raises InputError: unreadable, empty, or a wrong line (named)."""
    lines = list(lines_of(path, EXPECTED))
    if not lines:
        raise InputError(f"{path}: no pose in it; expected lines {EXPECTED}")
    place, words = lines[0]
    if not _is_number(words[0]):
        return _csv(path, lines)
    if len(words) == KITTI_WORDS:
        return _kitti(path, lines)
    # Eight numbers with microseconds are in TUM's order; nanoseconds are EuRoC's.
    min_digits = MIN_NS_DIGITS if len(words) == TUM_WORDS else MIN_US_DIGITS
    if len(words) >= EUROC_WORDS and words[0].isdecimal() and len(words[0]) >= min_digits:
        return _euroc(path, lines)
    if len(words) not in (TUM_WORDS, PLANAR_WORDS):
        raise InputError(f"{place}: {len(words)} numbers; expected {EXPECTED}")
    return _timed(path, lines, len(words))


def is_pose_line(words: list[str]) -> bool:
    """Whether the fields of a line are the numbers of a pose."""
    widths = (TUM_WORDS, PLANAR_WORDS, KITTI_WORDS)
    return all(map(_is_number, words)) and (len(words) in widths or len(words) > EUROC_WORDS)


def _timed(path: Path, lines: list[tuple[str, list[str]]], width: int) -> PoseSeries:
    """TUM or planar lines."""
    form = "t x y z qx qy qz qw" if width == TUM_WORDS else "t x y yaw"
    unit = _stamp_unit(lines[0][1][0])
    stamps = [_stamp(place, words[0], unit) for place, words in _equal(lines, width, form)]
    table = np.array([numbers_in(place, words[1:]) for place, words in lines])
    if width == PLANAR_WORDS:
        positions = np.column_stack([table[:, :2], np.zeros(len(table))])
        return PoseSeries(path.name, np.array(stamps, np.int64), positions, yaw=table[:, 2])
    quaternions = _checked_quaternions(lines, table[:, [6, 3, 4, 5]])
    return PoseSeries(path.name, np.array(stamps, np.int64), table[:, :3], quaternions)


def _euroc(path: Path, lines: list[tuple[str, list[str]]]) -> PoseSeries:
    width = len(lines[0][1])
    checked = _equal(lines, width, "stamp x y z qw qx qy qz")
    unit = _stamp_unit(lines[0][1][0])
    stamps = [_stamp(place, words[0], unit) for place, words in checked]
    table = np.array([numbers_in(place, words[1:EUROC_WORDS]) for place, words in lines])
    quaternions = _checked_quaternions(lines, table[:, 3:7])
    return PoseSeries(path.name, np.array(stamps, np.int64), table[:, :3], quaternions)


def _kitti(path: Path, lines: list[tuple[str, list[str]]]) -> PoseSeries:
    """Matrices without stamps; poses of a camera are turned into the plane that it drives in."""
    checked = _equal(lines, KITTI_WORDS, "12 numbers of a 3 x 4 matrix")
    matrices = np.array([numbers_in(place, words) for place, words in checked]).reshape(-1, 3, 4)
    positions, rotations = matrices[:, :, 3], matrices[:, :, :3]
    stamps = np.arange(len(matrices), dtype=np.int64) * NS_PER_S
    extent = np.ptp(positions, axis=0)
    if extent[2] > extent[1] and extent[1] < 0.5 * max(extent[0], extent[2]):
        yaw = np.unwrap(np.arctan2(-rotations[:, 0, 2], rotations[:, 2, 2]))
        in_plane = np.column_stack([positions[:, 2], -positions[:, 0], -positions[:, 1]])
        return PoseSeries(path.name, stamps, in_plane, yaw=yaw, has_stamps=False, notes=(CAMERA_NOTE,))
    yaw = np.unwrap(np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0]))
    return PoseSeries(path.name, stamps, positions, yaw=yaw, has_stamps=False)


def _csv(path: Path, lines: list[tuple[str, list[str]]]) -> PoseSeries:
    header, *rows = lines
    columns = _columns(header)
    if not rows:
        raise InputError(f"{path}: no pose below the header")
    cells = _equal(rows, len(header[1]), f"{len(header[1])} cells as in the header")
    unit = _stamp_unit(rows[0][1][columns["stamp"]])
    stamps = [_stamp(place, words[columns["stamp"]], unit) for place, words in cells]

    def numbers(*names: str) -> NDArray[np.float64]:
        return np.array(
            [numbers_in(place, [words[columns[name]] for name in names]) for place, words in rows]
        )

    positions = numbers("x", "y", "z") if "z" in columns else np.pad(numbers("x", "y"), ((0, 0), (0, 1)))
    times = np.array(stamps, np.int64)
    if "nanoseconds" in columns and not (times % NS_PER_S).any():
        times += np.array(
            [_stamp(place, words[columns["nanoseconds"]], "ns") for place, words in rows], np.int64
        )
    if set(QUATERNION) <= set(columns):
        return PoseSeries(path.name, times, positions, _checked_quaternions(rows, numbers(*QUATERNION)))
    yaw = numbers("yaw")[:, 0] if "yaw" in columns else np.radians(numbers("yaw_deg")[:, 0])
    return PoseSeries(path.name, times, positions, yaw=yaw)


def _columns(header: tuple[str, list[str]]) -> dict[str, int]:
    """The index of each known column. Raises InputError: stamp, x, y or the orientation is missing."""
    place, words = header
    if any(";" in word for word in words):
        raise InputError(
            f"{place}: semicolons between the columns; expected commas (and points in the numbers)"
        )
    names = [re.sub(r"\[.*?\]", "", word).strip("%#\"' ").lower() for word in words]
    found: dict[str, int] = {}
    for column, known in COLUMN_NAMES.items():
        for alias in known:
            matches = [i for i, name in enumerate(names) if name == alias or name.endswith(f".{alias}")]
            if matches:
                found[column] = matches[0]
                break
    missing = [name for name in ("stamp", "x", "y") if name not in found]
    if not ({"yaw", "yaw_deg"} & set(found) or set(QUATERNION) <= set(found)):
        missing.append("yaw (or qw, qx, qy, qz)")
    if missing:
        raise InputError(
            f"{place}: no column {', '.join(missing)} in this header; expected stamp, x, y, yaw, ..."
        )
    return found


def _stamp(place: str, word: str, unit: str) -> int:
    """A stamp in ns. Raises InputError with the place of a word that is none."""
    if unit == "s":
        return stamp_in(place, word)
    stamp = parse_stamp(word, unit)
    if stamp is None:
        raise InputError(
            f"{place}: {word[:40]!r} is not a stamp; expected {unit}, by the number of digits of the first stamp"
        )
    return stamp


def _stamp_unit(word: str) -> str:
    """The unit of stamps: of a whole number by its digits, else seconds."""
    if not word.isdigit():
        return "s"
    return next(unit for digits, unit in _UNIT_OF_DIGITS if len(word) >= digits)


def _equal(lines: list[tuple[str, list[str]]], width: int, form: str) -> list[tuple[str, list[str]]]:
    """The lines, each with `width` words. Raises InputError with the place of another one."""
    for place, words in lines:
        if len(words) != width:
            raise InputError(f"{place}: {len(words)} numbers; expected {form}")
    return lines


def _checked_quaternions(
    lines: list[tuple[str, list[str]]], quaternions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The quaternions `(n, 4)` normalised. Raises InputError: one is zero."""
    norms = np.linalg.norm(quaternions, axis=1)
    if not (norms > 0.0).all():
        place = lines[int(np.argmin(norms))][0]
        raise InputError(f"{place}: the quaternion is zero; expected a rotation")
    return np.asarray(quaternions / norms[:, None])


def _is_number(word: str) -> bool:
    try:
        return not math.isnan(parse_number(word)) or word.lower() == "nan"
    except ValueError:
        return False
