"""Reader of trajectories in text files, one pose per line. An invalid line is an error with its line number, never skipped."""

from __future__ import annotations

import codecs
import math
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gridslam.core.errors import InputError
from gridslam.core.plain_files import open_plain_file
from gridslam.core.poses import MAX_COORDINATE_M, yaw_of_quaternion
from gridslam.core.stamps import parse_stamp
from gridslam.core.texts import parse_number, parse_numbers
from gridslam.core.trajectory import Trajectory

MAX_BYTES = 1 << 28  # 256 MB, about three million poses
MAX_LINE_BYTES = 100_000
_HEAD_BYTES = 1 << 16
_TUM_WORDS, _PLANAR_WORDS = 8, 4
_TRAJECTORY_LINE = "t x y z qx qy qz qw, or t x y yaw"


def read_trajectory(path: Path) -> Trajectory:
    """Trajectory from a file with lines `t x y z qx qy qz qw` (TUM) or `t x y yaw`, all in the same form.

    The poses keep the order of the file; stamps are exact to the nanosecond. Raises InputError: the file is unreadable or has no
    pose, or a line is invalid (the message has its line number).
    """
    stamps, numbers = array("q"), array("d")
    width = 0
    for place, words in lines_of(path, _TRAJECTORY_LINE):
        width = width or len(words)
        if len(words) not in (_TUM_WORDS, _PLANAR_WORDS) or len(words) != width:
            raise InputError(f"{place}: {len(words)} numbers; expected {_TRAJECTORY_LINE}")
        stamps.append(stamp_in(place, words[0]))
        values = numbers_in(place, words[1:])
        if width == _TUM_WORDS and not math.hypot(*values[3:]) > 0.0:
            raise InputError(f"{place}: the quaternion is zero; expected a rotation")
        numbers.extend(values)
    if not stamps:
        raise InputError(f"{path}: no pose in it; expected lines {_TRAJECTORY_LINE}")
    table = np.array(numbers).reshape(len(stamps), width - 1)
    yaw = table[:, 2]
    if width == _TUM_WORDS:
        yaw = yaw_of_quaternion(table[:, [6, 3, 4, 5]])
    return Trajectory(np.array(stamps, np.int64), np.column_stack([table[:, :2], yaw]))


def lines_of(path: Path, expected: str) -> Iterator[tuple[str, list[str]]]:
    """Yield `("FILE:LINE", fields)` for each line that is not empty after comments (from `#` on) are removed.

    Fields are separated by spaces or commas. `expected` describes a valid line and is used in error messages. Raises InputError:
    the file cannot be read, is not a text file, or is larger than `MAX_BYTES`, or a line is longer than `MAX_LINE_BYTES`.
    """
    try:
        with open_plain_file(path) as stream:
            if path.stat().st_size > MAX_BYTES:
                raise InputError(f"{path}: larger than {MAX_BYTES >> 20} MB; expected lines {expected}")
            yield from _words_of(stream, path, expected)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; expected lines {expected}") from None


def _words_of(stream: BinaryIO, path: Path, expected: str) -> Iterator[tuple[str, list[str]]]:
    # A binary file raises UnicodeDecodeError here, before its lines are read.
    codecs.getincrementaldecoder("utf-8")().decode(stream.read(_HEAD_BYTES))
    stream.seek(0)
    number = 0
    while line := stream.readline(MAX_LINE_BYTES):
        number += 1
        if len(line) == MAX_LINE_BYTES:
            raise InputError(
                f"{path}:{number}: a line of more than {MAX_LINE_BYTES} bytes; expected lines {expected}"
            )
        text = line.decode("utf-8-sig" if number == 1 else "utf-8")
        words = text.partition("#")[0].replace(",", " ").split()
        if words:
            yield f"{path}:{number}", words


def stamp_in(place: str, word: str) -> int:
    """Stamp (ns) from a field in seconds. Raises InputError, which begins with `place` (file and line): it is not valid."""
    stamp = parse_stamp(word)
    if stamp is None:
        raise InputError(f"{place}: {word[:40]!r} is not a stamp; expected seconds between 0 and 2^31")
    return stamp


def numbers_in(place: str, words: list[str]) -> list[float]:
    """Numbers from fields. Raises InputError, which begins with `place`: one is NaN, infinite, too large or no number."""
    try:
        values = parse_numbers(words)
        if all(-MAX_COORDINATE_M <= value <= MAX_COORDINATE_M for value in values):
            return values
    except ValueError:
        pass
    wrong = next(word for word in words if not _is_coordinate(word))
    raise InputError(
        f"{place}: {wrong[:40]!r} is not a number up to {MAX_COORDINATE_M:g}; correct the line or leave it out"
    )


def _is_coordinate(word: str) -> bool:
    try:
        return abs(parse_number(word)) <= MAX_COORDINATE_M
    except ValueError:
        return False
