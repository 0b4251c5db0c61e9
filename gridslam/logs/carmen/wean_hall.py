"""The Wean Hall text logs of CMU, in centimetres, radians and seconds.

Their lines are `O x y th t` (odometry) and `L x y th xl yl thl r1..r180 t` (odometry, laser, ranges).
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from gridslam.core.messages import Event, LaserScan, Odometry, Transform, as_float32, canonical_yaw, readonly
from gridslam.core.poses import between
from gridslam.core.stamps import parse_stamp
from gridslam.core.texts import parse_numbers
from gridslam.logs import rotations
from gridslam.logs.carmen.lines import beam_angles
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import Skip, SkipReason
from gridslam.logs.streams import RecordedStream
from gridslam.logs.text import TextLines, packing_of

_FIELDS_BEFORE_RANGES = 7
_NO_RETURN_M = 81.83  # readings from here on are the SICK LMS's codes for no return


def looks_like_wean_hall(text: bytes) -> bool:
    """Whether the first line is an `O` or `L` line of numbers."""
    words = text.split(b"\n", 1)[0].split()
    if not words or words[0] not in (b"O", b"L") or len(words) < 5:
        return False
    return parse_stamp(words[-1].decode("ascii", "replace")) is not None and not isinstance(
        _numbers(words[1:4]), SkipReason
    )


class WeanHallSource:
    """Streams `L` (scans) and `O` (the odometry of both kinds of line, in the file's order)."""

    format = "Wean Hall text"
    order: Literal["recorded", "stamp"] = "recorded"
    base_frame: str | None = "base_link"

    def __init__(self, path: Path, config: LogConfig) -> None:
        self.files = [path]
        self.message_counts = MessageCounts()
        self.compression = packing_of(path)
        self.static_edges: list[Transform] = []
        self._range_max = as_float32(config.carmen.range_max_m or _NO_RETURN_M)
        self._field_of_view_deg = config.carmen.field_of_view_deg
        self._lines = TextLines(path, self.message_counts, config.limits.line_mb << 20)
        odometry = RecordedStream(
            "odom",
            "O",
            "Wean Hall odometry",
            stamps_ns=array("q"),
            frames={"odom": None},
            child_frame="base_link",
        )
        scans = RecordedStream("scan", "L", "Wean Hall scan", stamps_ns=array("q"), frames={"laser": None})
        self.streams = [odometry, scans]
        self._index()

    def close(self) -> None:
        """Free what is kept between passes; no file stays open."""
        self._lines.forget()

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Odometry of every line, and the scan of an L line, in the file's order."""
        for _, line in self._lines:
            words = line.split()
            read = _line(words)
            if isinstance(read, SkipReason):
                continue
            stamp, values = read
            if 0 in wanted:
                yaw = canonical_yaw(math.atan2(math.sin(values[2]), math.cos(values[2])))
                yield 0, Odometry(stamp, "odom", values[0] / 100.0, values[1] / 100.0, yaw)
            if words[0] == b"L" and 1 in wanted:
                ranges = np.array(values[6:]) / 100.0
                angle_min, increment = beam_angles(len(ranges), self._field_of_view_deg)
                yield (
                    1,
                    LaserScan(
                        stamp,
                        "laser",
                        readonly(ranges, np.float32),
                        angle_min_rad=as_float32(angle_min),
                        angle_increment_rad=as_float32(increment),
                        range_min_m=0.0,
                        range_max_m=self._range_max,
                    ),
                )

    def _index(self) -> None:
        offset: tuple[float, float, float] | None = None
        for number, line in self._lines:
            words = line.split()
            if not words:
                continue
            read = _line(words)
            if isinstance(read, SkipReason):
                stream = "scan" if words[0] == b"L" else "odom"
                self.message_counts.skip(stream, read.value, f"{self._lines.path.name} line {number}")
                continue
            stamp, values = read
            self.streams[0].stamps_ns.append(stamp)
            if words[0] == b"L":
                self.streams[1].stamps_ns.append(stamp)
                if offset is None:
                    x, y, yaw = (float(v) for v in between(values[:3], values[3:6]))
                    # The log has six decimals of a centimetre; the tenth of a millimetre is what they can
                    # mean.
                    offset = (round(x / 100.0, 4) + 0.0, round(y / 100.0, 4) + 0.0, round(yaw, 6) + 0.0)
        if offset is not None:
            pose = (offset[0], offset[1], 0.0), rotations.from_euler(0.0, 0.0, offset[2])
            self.static_edges.append(Transform(0, "base_link", "laser", *pose, is_static=True))


def _line(words: list[bytes]) -> tuple[int, list[float]] | SkipReason:
    """(stamp_ns, numbers between the letter and the stamp), or the reason why the line cannot be used."""
    if not words or words[0] not in (b"O", b"L"):
        return SkipReason.UNKNOWN_LINE
    if len(words) != 5 if words[0] == b"O" else len(words) <= _FIELDS_BEFORE_RANGES + 1:
        return SkipReason.WRONG_NUMBER_OF_FIELDS
    stamp = parse_stamp(words[-1].decode("ascii", "replace"))
    if stamp is None:
        return SkipReason.BAD_STAMP
    values = _numbers(words[1:-1])
    if not isinstance(values, SkipReason) and not all(map(math.isfinite, values[:3])):
        return SkipReason.NOT_FINITE
    return values if isinstance(values, SkipReason) else (stamp, values)


def _numbers(words: Sequence[bytes]) -> list[float] | SkipReason:
    try:
        return parse_numbers(words)
    except ValueError:
        return SkipReason.UNREADABLE_LINE
