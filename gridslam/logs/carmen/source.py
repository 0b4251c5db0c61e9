"""CARMEN text logs as a source of streams.

Every laser line gives two events of one stamp, the odometry in it and the scan. ODOM lines are a second
opinion about the same odometry, published on its own and with its own delay: where laser lines carry
odometry they are left aside (and counted), else they are the odometry.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from gridslam.core.messages import Event, LaserScan, Transform, as_float32
from gridslam.core.texts import parse_number
from gridslam.core.turned_pairs import TurnedPairs
from gridslam.logs import rotations
from gridslam.logs.carmen.lines import (
    LASERS,
    OTHER_MESSAGES,
    LaserLine,
    beam_angles,
    laser_line,
    odom_line,
    odom_stamps,
    odometry_in,
    old_laser_lines,
)
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import Skip, SkipReason
from gridslam.logs.streams import RecordedStream
from gridslam.logs.text import TextLines, packing_of

DEFAULT_RANGE_MAX_M = 81.91  # the largest number a SICK LMS gives, its code for no return
# Numbers of beams of the lasers of these logs, 180 degrees wide
SICK_BEAMS = (90, 91, 180, 181, 360, 361, 720, 721)
MIN_BEAMS = 60  # fewer are left of thinned scans, of whatever laser
USUAL_WIDTHS_DEG, USUAL_STEPS_DEG = (180.0, 190.0, 240.0, 270.0), (0.25, 0.5, 1.0)
MIN_WIDTH_DEG = 90.0
_SAME_OFFSET = 1e-3  # m and rad: a laser whose place differs by more has been moved by a corrected pose
# If the largest reading makes up this fraction of all readings, it is not a distance but means "no return".
_MIN_PILED_FRACTION = 0.001
_WORD_BYTES = 12  # ROBOTLASER1 and the space behind it
_BATCH_LINES = 256
_BATCH_BYTES = 1 << 19
_KEPT_READINGS = 4_000_000  # laser lines are parsed once up to here (16 MB), again on each pass beyond


@dataclass(slots=True)
class _LaserIndex:
    """Readings, beams and stamps of one kind of laser line, collected by the index pass."""

    largest: float = 0.0
    at_largest: int = 0
    readings: int = 0
    offset: tuple[float, float, float] | None = None
    offset_varies: bool = False
    has_poses: bool = True
    beams: int = 0  # of the first line without angles of its own
    turned: TurnedPairs = field(default_factory=TurnedPairs)
    stamps: array[int] = field(default_factory=lambda: array("q"))


class CarmenSource:
    """Streams are named by their message: scans and odometry of FLASER lines `FLASER`, and so on."""

    format = "CARMEN"
    order: Literal["recorded", "stamp"] = "recorded"
    base_frame: str | None = "base_link"

    def __init__(self, path: Path, config: LogConfig) -> None:
        self.files = [path]
        self.message_counts = MessageCounts()
        self.compression = packing_of(path)
        self.static_edges: list[Transform] = []
        self.streams: list[RecordedStream] = []
        self._config = config.carmen
        self._lines = TextLines(path, self.message_counts, config.limits.line_mb << 20)
        self._parsed: dict[int, LaserLine] = {}
        self._scan_of: dict[bytes, int] = {}
        self._odometry_of: dict[bytes, int] = {}
        self._range_max: dict[bytes, float] = {}
        self._width_deg: dict[bytes, float | None] = {}
        named = config.topics.get("odom")
        self._odometry_topic = named if isinstance(named, str) else None
        self._index()

    def close(self) -> None:
        """Free what is kept between passes; no file stays open."""
        self._parsed = {}
        self._lines.forget()

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Odometry and scan of every line, in the file's order."""
        for number, word, line, laser in self._taken_apart():
            scan, odometry = self._scan_of.get(word), self._odometry_of.get(word)
            if word == b"ODOM" and odometry in wanted and odometry is not None:
                read = odom_line(line)
                if not isinstance(read, SkipReason):
                    yield odometry, read
            elif scan is not None and (scan in wanted or odometry in wanted):
                if laser is None or isinstance(laser, SkipReason):
                    continue
                if odometry is not None and odometry in wanted:
                    yield odometry, odometry_in(laser)
                if scan in wanted:
                    yield scan, self._scan(word, laser, number)

    def _place(self, number: int) -> str:
        return f"{self._lines.path.name} line {number}"

    def _index(self) -> None:
        """The index pass: stamps, the value that means "no return", and the laser's extrinsics."""
        found: dict[bytes, _LaserIndex] = {}
        odom = array("q")
        front_offset: float | None = None
        readings = 0
        odom_lines: list[tuple[int, bytes]] = []
        for number, word, line, laser in self._taken_apart():
            if isinstance(laser, SkipReason):
                self.message_counts.skip("scan", laser.value, self._place(number))
            elif laser is not None:
                _note_laser(found.setdefault(word, _LaserIndex()), laser)
                readings += len(laser.ranges)
                if readings <= _KEPT_READINGS:
                    self._parsed[number] = laser
            elif word == b"ODOM":
                odom_lines.append((number, line))
                if len(odom_lines) >= _BATCH_LINES:
                    self._note_odom(odom_lines, odom)
                    odom_lines = []
            elif word == b"PARAM" and b"frontlaser_offset" in line:
                front_offset = _number(line.split()[2]) if len(line.split()) > 2 else 0.0
            elif word and word not in OTHER_MESSAGES:
                self.message_counts.count("unused.other")
        self._note_odom(odom_lines, odom)
        self._lines.shorten(self._parsed, _WORD_BYTES)
        for word, index in found.items():
            self._add_laser(word, index, front_offset)
        self._add_odometry(found, odom)

    def _note_odom(self, lines: Sequence[tuple[int, bytes]], stamps: array[int]) -> None:
        """Add the stamps of numbered ODOM lines; those that cannot be used are counted."""
        found = odom_stamps([line for _, line in lines])
        for (number, _), stamp in zip(lines, found, strict=True):
            if isinstance(stamp, SkipReason):
                self.message_counts.skip("odom", stamp.value, self._place(number))
            else:
                stamps.append(stamp)

    def _taken_apart(self) -> Iterator[tuple[int, bytes, bytes, LaserLine | SkipReason | None]]:
        """(number, first word, line, fields of a laser line) of every line; laser lines are parsed in batches."""
        for batch in _batches((number, line) for number, line in self._lines if line[:1] != b"#"):
            words = [line[:_WORD_BYTES].split(b" ", 1)[0] for _, line in batch]
            at = [i for i, word in enumerate(words) if word in LASERS and batch[i][0] not in self._parsed]
            together = [i for i in at if not words[i].startswith((b"ROBOTLASER", b"RAWLASER"))]
            parsed: dict[int, LaserLine | SkipReason | None] = dict(
                zip(together, old_laser_lines([batch[i][1] for i in together]), strict=True)
            )
            for i in at:
                if parsed.get(i) is None:
                    parsed[i] = laser_line(words[i], batch[i][1])
            for i, (number, line) in enumerate(batch):
                yield number, words[i], line, parsed.get(i) or self._parsed.get(number)

    def _add_laser(self, word: bytes, index: _LaserIndex, front_offset: float | None) -> None:
        frame = LASERS[word]
        self._scan_of[word] = len(self.streams)
        self.streams.append(
            RecordedStream(
                "scan", word.decode(), "CARMEN " + word.decode(), stamps_ns=index.stamps, frames={frame: None}
            )
        )
        self._width_deg[word] = self._config.field_of_view_deg
        if index.beams >= MIN_BEAMS and self._config.field_of_view_deg is None:
            self._find_width(word, index)
        piled = index.at_largest >= max(10, _MIN_PILED_FRACTION * index.readings)
        found = index.largest if piled else DEFAULT_RANGE_MAX_M
        self._range_max[word] = as_float32(self._config.range_max_m or found)
        if index.offset is not None and not index.offset_varies:
            x, y, yaw = index.offset
        elif word in (b"FLASER", b"ROBOTLASER1") and front_offset is not None:
            x, y, yaw = front_offset, 0.0, 0.0
        else:
            return  # where the laser sits is not known: `Log` says so
        pose = (x, y, 0.0), rotations.from_euler(0.0, 0.0, yaw)
        self.static_edges.append(Transform(0, "base_link", frame, *pose, is_static=True))

    def _find_width(self, word: bytes, index: _LaserIndex) -> None:
        """Find the field of view of a laser whose lines hold no angles, by the robot's turns, and say what is taken."""
        _, assumed = beam_angles(index.beams)
        intervals = index.beams - 1
        others = [math.radians(width) / intervals for width in _widths_deg(index.beams)]
        step = index.turned.better_step(index.beams, assumed, others)
        what = f"{word.decode()}: lines of {index.beams} beams hold no angles"
        if step is not None:
            found = self._width_deg[word] = math.degrees(step * intervals)
            self.message_counts.find(
                f"{what}: by the robot's turns they are {found:.4g} degrees wide; log.carmen.field_of_view_deg sets another width"
            )
        elif index.beams not in SICK_BEAMS:
            self.message_counts.find(
                f"{what}: taken as 180 degrees wide; for another lidar set log.carmen.field_of_view_deg "
                f"({index.beams - 1} for beams at 1 degree)"
            )

    def _add_odometry(self, found: dict[bytes, _LaserIndex], odom: array[int]) -> None:
        """Add the odometry: that of the main laser's lines, or ODOM lines if there is no laser or the config names them."""
        with_poses = [word for word in found if found[word].has_poses]
        main = max(with_poses, key=lambda word: len(found[word].stamps), default=None)
        if odom and (main is None or self._odometry_topic == "ODOM"):
            source, stamps = b"ODOM", odom
        elif main is not None:
            source, stamps = main, found[main].stamps
            if odom:
                self.message_counts.count("unused.odom", len(odom))
        else:
            return
        self._odometry_of[source] = len(self.streams)
        self.streams.append(
            RecordedStream(
                "odom",
                source.decode(),
                "CARMEN odometry",
                detail="",
                stamps_ns=stamps,
                frames={"odom": None},
                child_frame="base_link",
            )
        )

    def _scan(self, word: bytes, laser: LaserLine, number: int) -> Event | Skip:
        count = len(laser.ranges)
        if count == 0:
            return Skip(SkipReason.NO_BEAMS, self._place(number))
        if laser.geometry is not None:
            angle_min, increment, range_max = laser.geometry
            range_max = self._config.range_max_m or range_max
        else:
            angle_min, increment = beam_angles(count, self._width_deg[word])
            range_max = self._range_max[word]
        return LaserScan(
            laser.stamp_ns,
            LASERS[word],
            laser.ranges,
            angle_min_rad=as_float32(angle_min),
            angle_increment_rad=as_float32(increment),
            range_min_m=0.0,
            range_max_m=as_float32(range_max),
        )


def _widths_deg(beams: int) -> list[float]:
    """Usual angles (deg) from the first to the last of the beams: those of models, of whole circles, and of usual steps."""
    widths = [
        *USUAL_WIDTHS_DEG,
        360.0 * (beams - 1) / beams,
        *(step * (beams - 1) for step in USUAL_STEPS_DEG),
    ]
    return [width for width in widths if MIN_WIDTH_DEG <= width <= 360.0]


def _batches(lines: Iterable[tuple[int, bytes]]) -> Iterator[list[tuple[int, bytes]]]:
    """Up to `_BATCH_LINES` numbered lines at a time, fewer where they are long."""
    batch: list[tuple[int, bytes]] = []
    size = 0
    for line in lines:
        batch.append(line)
        size += len(line[1])
        if len(batch) >= _BATCH_LINES or size >= _BATCH_BYTES:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


def _note_laser(index: _LaserIndex, laser: LaserLine) -> None:
    """Add one line to the index: its stamp, its largest readings, the laser's pose on the robot."""
    index.stamps.append(laser.stamp_ns)
    index.readings += len(laser.ranges)
    largest = float(laser.ranges.max(initial=0.0))
    if not math.isfinite(largest):
        largest = float(np.max(laser.ranges, initial=0.0, where=np.isfinite(laser.ranges)))
    if largest > index.largest:
        index.largest, index.at_largest = largest, 0
    if largest == index.largest:
        index.at_largest += int(np.count_nonzero(laser.ranges == largest))
    if laser.geometry is None:
        index.beams = index.beams or len(laser.ranges)
        if laser.robot_pose is not None:
            index.turned.add(laser.robot_pose, laser.ranges)
    if index.offset_varies:
        return
    if laser.robot_pose is None:
        index.has_poses = False
        return
    offset = _offset(laser)
    if index.offset is None:
        index.offset = offset
    elif max(abs(a - b) for a, b in zip(index.offset, offset, strict=True)) > _SAME_OFFSET:
        index.offset_varies = True


def _offset(laser: LaserLine) -> tuple[float, float, float]:
    """T_robot_laser, rounded to the six decimals that the lines have."""
    if laser.robot_pose == laser.laser_pose:
        return 0.0, 0.0, 0.0
    (rx, ry, ryaw), (lx, ly, lyaw) = laser.robot_pose or (0.0, 0.0, 0.0), laser.laser_pose
    cos, sin = math.cos(ryaw), math.sin(ryaw)
    dx, dy = lx - rx, ly - ry
    yaw_offset = math.remainder(lyaw - ryaw, 2.0 * math.pi)
    return (
        round(cos * dx + sin * dy, 6) + 0.0,
        round(cos * dy - sin * dx, 6) + 0.0,
        round(yaw_offset, 6) + 0.0,
    )


def _number(word: bytes) -> float:
    try:
        value = parse_number(word)
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0
