"""CARMEN text logs as a source of streams.

Every laser line gives two events with the same stamp: the odometry in it and the scan. ODOM lines repeat that odometry with
another delay. They are used only if no laser line has odometry, or if the config names them; else they are counted as unused.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from gridslam.core.messages import Event, LaserScan, Transform, as_float32
from gridslam.core.texts import parse_number
from gridslam.logs import rotations
from gridslam.logs.carmen.laser_index import LaserIndex
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
from gridslam.logs.text import TextLines, in_batches, packing_of

_WORD_BYTES = 12  # the longest first word, ROBOTLASER1, and the space behind it
_BATCH_LINES = 256
_BATCH_BYTES = 1 << 19
# Parsed laser lines are kept up to this many readings (16 MB); later ones are parsed again on each pass
_KEPT_READINGS = 4_000_000


class CarmenSource:
    """The streams of a CARMEN log. Their topics are the first words of their lines, such as FLASER."""

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
        """Free the memory used between passes; no file is open then."""
        self._parsed = {}
        self._lines.forget()

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """The events of the wanted streams, in the order of the file."""
        for number, word, line, laser in self._parsed_lines():
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
        """A line of the file, in words."""
        return f"{self._lines.path.name} line {number}"

    def _index(self) -> None:
        """Read the log once, and add the streams of its lasers and of the odometry."""
        lasers: dict[bytes, LaserIndex] = {}
        odom = array("q")
        front_offset: float | None = None
        readings = 0
        odom_lines: list[tuple[int, bytes]] = []
        for number, word, line, laser in self._parsed_lines():
            if isinstance(laser, SkipReason):
                self.message_counts.skip("scan", laser.value, self._place(number))
            elif laser is not None:
                lasers.setdefault(word, LaserIndex()).add(laser)
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
        for word, index in lasers.items():
            self._add_laser(word, index, front_offset)
        self._add_odometry(lasers, odom)

    def _note_odom(self, lines: Sequence[tuple[int, bytes]], stamps: array[int]) -> None:
        """Append the stamps of numbered ODOM lines; lines that cannot be used are counted as skipped."""
        found = odom_stamps([line for _, line in lines])
        for (number, _), stamp in zip(lines, found, strict=True):
            if isinstance(stamp, SkipReason):
                self.message_counts.skip("odom", stamp.value, self._place(number))
            else:
                stamps.append(stamp)

    def _parsed_lines(self) -> Iterator[tuple[int, bytes, bytes, LaserLine | SkipReason | None]]:
        """(number, first word, line, parsed laser line) of every line that is not a comment; None for lines of other messages.

        Laser lines are parsed in batches, and only if they have not been kept from the index pass.
        """
        lines = ((number, line) for number, line in self._lines if line[:1] != b"#")
        for batch in in_batches(lines, _BATCH_LINES, _BATCH_BYTES):
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

    def _add_laser(self, word: bytes, index: LaserIndex, front_offset: float | None) -> None:
        """Add the stream of a laser, with its extrinsics; `front_offset` (m) is the PARAM frontlaser_offset."""
        frame = LASERS[word]
        self._scan_of[word] = len(self.streams)
        self.streams.append(
            RecordedStream(
                "scan",
                word.decode(),
                "CARMEN " + word.decode(),
                stamps_ns=index.stamps_ns,
                frames={frame: None},
            )
        )
        self._width_deg[word] = self._config.field_of_view_deg or self._find_width_deg(word, index)
        self._range_max[word] = as_float32(self._config.range_max_m or index.range_max_m)
        if index.T_robot_laser is not None:
            x, y, yaw = index.T_robot_laser
        elif word in (b"FLASER", b"ROBOTLASER1") and front_offset is not None:
            x, y, yaw = front_offset, 0.0, 0.0
        else:
            return  # the laser's extrinsics are unknown; `Log` reports that
        pose = (x, y, 0.0), rotations.from_euler(0.0, 0.0, yaw)
        self.static_edges.append(Transform(0, "base_link", frame, *pose, is_static=True))

    def _find_width_deg(self, word: bytes, index: LaserIndex) -> float | None:
        """The field of view of a laser, found by the robot's turns, if its lines do not state angles; None for that of a SICK.

        A line in the problems of the log says which one is taken.
        """
        what = f"{word.decode()}: lines of {index.beams} beams hold no angles"
        width_deg = index.turned_width_deg()
        if width_deg is not None:
            self.message_counts.find(
                f"{what}: by the robot's turns they are {width_deg:.4g} degrees wide; "
                "log.carmen.field_of_view_deg sets another width"
            )
        elif not index.is_usual:
            self.message_counts.find(
                f"{what}: taken as 180 degrees wide; for another lidar set log.carmen.field_of_view_deg "
                f"({index.beams - 1} for beams at 1 degree)"
            )
        return width_deg

    def _add_odometry(self, lasers: dict[bytes, LaserIndex], odom: array[int]) -> None:
        """Add the odometry stream: from the laser with the most lines, or from ODOM lines (`odom` are their stamps, ns).

        ODOM lines are used if no laser line has poses, or if the config names them.
        """
        with_poses = [word for word in lasers if lasers[word].has_poses]
        main = max(with_poses, key=lambda word: len(lasers[word].stamps_ns), default=None)
        if odom and (main is None or self._odometry_topic == "ODOM"):
            source, stamps = b"ODOM", odom
        elif main is not None:
            source, stamps = main, lasers[main].stamps_ns
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
        """The scan of a laser line, with the line's own geometry or that found for its laser."""
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


def _number(word: bytes) -> float:
    """The number in a word; 0 if it is not a finite number."""
    try:
        value = parse_number(word)
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0
