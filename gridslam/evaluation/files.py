"""Trajectories and relations as text, one a line; `#` begins a comment. A wrong line is named, never skipped."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gridslam.core.errors import InputError
from gridslam.core.poses import yaw_of_quaternion
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.relations import Relations
from gridslam.logs.stamps import parse_stamp

MAX_BYTES = 1 << 30
LARGEST = 1e9  # metres: beyond it no centimetre is left in the arithmetic
_TUM_WORDS, _PLANAR_WORDS, _RELATION_WORDS = 8, 4, 8
_TRAJECTORY_LINE = "t x y z qx qy qz qw, or t x y yaw"
_RELATION_LINE = "t1 t2 x y z roll pitch yaw"


def read_trajectory(path: Path) -> Trajectory:
    """Lines `t x y z qx qy qz qw` (TUM) or `t x y yaw` in the file's order; stamps exact to the nanosecond.

    Raises InputError: the file is unreadable or has no pose, or a line is wrong (the message names it).
    """
    stamps: list[int] = []
    numbers: list[list[float]] = []
    width = 0
    for place, words in _lines(path, _TRAJECTORY_LINE):
        width = width or len(words)
        if len(words) not in (_TUM_WORDS, _PLANAR_WORDS) or len(words) != width:
            raise InputError(f"{place}: {len(words)} numbers; expected {_TRAJECTORY_LINE}")
        stamps.append(_stamp(place, words[0]))
        values = _numbers(place, words[1:])
        if width == _TUM_WORDS and not math.hypot(*values[3:]) > 0.0:
            raise InputError(f"{place}: the quaternion is zero; expected a rotation")
        numbers.append(values)
    if not stamps:
        raise InputError(f"{path}: no pose in it; expected lines {_TRAJECTORY_LINE}")
    table = np.array(numbers)
    yaw = table[:, 2]
    if width == _TUM_WORDS:
        yaw = yaw_of_quaternion(table[:, [6, 3, 4, 5]])
    return Trajectory(np.array(stamps, np.int64), np.column_stack([table[:, :2], yaw]))


def read_relations(path: Path) -> Relations:
    """Lines `t1 t2 x y z roll pitch yaw`; z, roll and pitch are left out. Raises InputError as above."""
    stamps: list[tuple[int, int]] = []
    motions: list[tuple[float, float, float]] = []
    for place, words in _lines(path, _RELATION_LINE):
        if len(words) != _RELATION_WORDS:
            raise InputError(f"{place}: {len(words)} numbers; expected {_RELATION_LINE}")
        stamps.append((_stamp(place, words[0]), _stamp(place, words[1])))
        x, y, _, _, _, yaw = _numbers(place, words[2:])
        motions.append((x, y, yaw))
    if not stamps:
        raise InputError(f"{path}: no relation in it; expected lines {_RELATION_LINE}")
    ends = np.array(stamps, np.int64)
    return Relations(ends[:, 0], ends[:, 1], np.array(motions))


def _lines(path: Path, expected: str) -> Iterator[tuple[str, list[str]]]:
    """The place (file and line number) and the words of each line that is not empty."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: larger than {MAX_BYTES >> 20} MB; expected lines {expected}")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; expected lines {expected}") from None
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            yield f"{path}:{number}", words


def _stamp(place: str, word: str) -> int:
    stamp = parse_stamp(word)
    if stamp is None:
        raise InputError(f"{place}: {word[:40]!r} is no stamp; expected seconds between 0 and 2^31")
    return stamp


def _numbers(place: str, words: list[str]) -> list[float]:
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            raise InputError(
                f"{place}: {word[:40]!r} is no number up to {LARGEST:g}; correct the line or leave it out"
            )
        values.append(value)
    return values
