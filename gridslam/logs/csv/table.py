"""One CSV file as a stream: rows to events by the layout's columns, units and constants."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import LogError
from gridslam.core.messages import Event
from gridslam.logs.csv.events import BUILDERS, FILE_FAULTS
from gridslam.logs.csv.layout import COLUMNS, DEFAULT_FRAMES, CsvStream
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.stamps import END_NS, NS_PER_S, parse_stamp
from gridslam.logs.streams import Skip
from gridslam.logs.text import TextLines

_FACTORS: dict[str, Callable[[float], float]] = {
    "m": float,
    "cm": lambda v: v / 100.0,
    "mm": lambda v: v / 1000.0,
    "rad": float,
    "deg": math.radians,
    "rad_clockwise": lambda v: -v,
    "deg_clockwise": lambda v: -math.radians(v),
    "s": float,
    "ms": lambda v: v / 1e3,
    "us": lambda v: v / 1e6,
    "ns": lambda v: v / 1e9,
    "m/s": float,
    "rad/s": float,
    "deg/s": math.radians,
}
Floats: TypeAlias = NDArray[np.float64]
_TEXT_COLUMNS = frozenset({"sensor", "antenna", "tag_id", "camera", "file", "frame", "parent", "child"})


class Row:
    """One row: its place, stamp and fields, with access by our column names."""

    __slots__ = ("_fields", "_table", "line", "stamp_ns")

    def __init__(self, table: CsvTable, line: int, stamp_ns: int, fields: list[str]) -> None:
        self._table = table
        self._fields = fields
        self.line = line
        self.stamp_ns = stamp_ns

    def text(self, name: str, absent: str = "") -> str:
        """A text column; `absent` where there is none or the field is empty."""
        place = self._table.places.get(name)
        value = self._table.texts.get(name, "") if place is None else self._fields[place].strip()
        return value or absent

    def number(self, name: str, absent: float | None = None) -> float:
        """A numeric column in our units. ValueError where it has no value and `absent` is not given."""
        place = self._table.places.get(name)
        if place is None:
            constant = self._table.numbers.get(name, absent)
            if constant is None:
                raise ValueError(name)
            return constant
        field = self._fields[place]
        if absent is not None and not field.strip():
            return absent
        return self._table.convert[name](float(field))

    def ranges(self) -> list[str]:
        """The fields from the first range on, without the empty ones at the end."""
        fields = self._fields[self._table.first_range :]
        while fields and not fields[-1].strip():
            fields.pop()
        return fields


class CsvTable:
    """A stream of one file. `survey` comes first; `events` gives one entry per stamp of the survey."""

    def __init__(
        self,
        folder: Path,
        path: Path,
        stream: CsvStream,
        message_counts: MessageCounts,
        line_limit_bytes: int,
    ) -> None:
        self.stream = stream
        self.path = path
        self.places: dict[str, int] = {}
        self.texts: dict[str, str] = {}
        self.numbers: dict[str, float] = {}
        self.convert: dict[str, Callable[[float], float]] = {}
        self.first_range = 0
        self._folder = folder
        self._message_counts = message_counts
        self._lines = TextLines(path, message_counts, line_limit_bytes)
        self._counting = False
        self._width = 0
        self._period_ns, self._start_ns = self._row_clock()
        self._read_header()

    def survey(self) -> tuple[array[int], dict[str, None]]:
        """Stamps of all events and the frames in use; enters unusable rows in the message_counts."""
        stamps = array("q")
        frames: dict[str, None] = {}
        fixed = self.stream.kind != "range" and "frame" not in self.places
        if fixed and self.stream.kind not in ("tags", "image", "depth", "disparity", "camera_info"):
            frames[self._frame_by_kind()] = None
        else:
            fixed = False
        self._counting = True
        for rows in self._groups():
            stamps.append(rows[0].stamp_ns)
            if not fixed and len(frames) < 1000:
                frames[self.frame_of(rows[0])] = None
        self._counting = False
        return stamps, frames

    def events(self) -> Iterator[Event | Skip]:
        """One event, or the reason why there is none, per entry of the survey's stamps."""
        build = BUILDERS[self.stream.kind]
        for rows in self._groups():
            yield self._event(build, rows)

    def _event(self, build: Callable[[CsvTable, list[Row]], Event], rows: list[Row]) -> Event | Skip:
        try:
            return build(self, rows)
        except (ValueError, OverflowError) as error:
            reason = str(error) if str(error) in FILE_FAULTS else "unreadable_row"
            return Skip(reason, f"{self.path.name} line {rows[0].line}")

    def edges(self) -> set[tuple[str, str]]:
        """Of a table of transforms: which parents and children are in it."""
        return {(row.text("parent"), row.text("child")) for row in self._rows()}

    def frame_of(self, row: Row) -> str:
        """frame_id of a row's message."""
        if self.stream.kind == "range":
            return row.text("sensor", self._frame_by_kind())
        absent = self.stream.frame or row.text("antenna") or row.text("camera") or self._frame_by_kind()
        return row.text("frame", absent)

    def folder_file(self, name: str) -> Path:
        """The file that a row names. ValueError where it lies outside the log's folder."""
        path = inside(self._folder, name)
        if path is None:
            raise ValueError("file_outside_folder")
        if not path.is_file():
            raise ValueError("missing_file")
        return path

    def mark_invalid(self, values: Floats) -> Floats:
        """Readings in the file's unit with NaN for those that mean no return."""
        for value in self.stream.invalid:
            values[values == value] = np.nan
        if self.stream.invalid_from is not None:
            values[values >= self.stream.invalid_from] = np.nan
        return values

    def to_metres(self, values: Floats) -> Floats:
        """Range readings of the file in metres."""
        divisor = {"cm": 100.0, "mm": 1000.0}.get(self.stream.units.get("r", "m"))
        return values if divisor is None else values / divisor

    def _frame_by_kind(self) -> str:
        return self.stream.frame or DEFAULT_FRAMES.get(self.stream.kind, self.stream.kind)

    def _row_clock(self) -> tuple[int, int]:
        clock = self.stream.row_stamps
        if clock is None:
            return 0, 0
        return round(clock.period_s * NS_PER_S), round(clock.start_s * NS_PER_S)

    def _read_header(self) -> None:
        header = next((line for _, line in self._lines if line), None)
        names = [] if header is None else _split(header, self.stream.delimiter)
        names = [] if names is None else [n.strip().removeprefix("\ufeff") for n in names]
        stream, kind = self.stream, COLUMNS[self.stream.kind]
        self._width = len(names)
        needed = (() if stream.row_stamps else ("stamp",)) + kind.required
        for name in (*needed, *kind.optional, *(() if stream.row_stamps else ("stamp",))):
            theirs = stream.columns.get(name, name)
            if theirs in names:
                self.places[name] = names.index(theirs)
                self.convert[name] = _FACTORS[stream.units.get(name, "m")]
            elif name in stream.constants:
                self._add_constant(name, stream.constants[name])
            elif name in needed:
                raise LogError(
                    f"{self.path}: no column {theirs!r} for {name}; "
                    f"the header has: {', '.join(names[:20]) or 'nothing'}. "
                    f"Rename it in log.yaml: streams: - {{kind: {stream.kind}, file: {stream.file}, "
                    f"columns: {{{name}: COLUMN}}}}"
                )
        if stream.kind == "scan":
            first = stream.columns.get("r", "r") + "0"
            if first not in names:
                raise LogError(f"{self.path}: no column {first!r} where the ranges begin")
            self.first_range = names.index(first)

    def _add_constant(self, name: str, value: float | str) -> None:
        if name in _TEXT_COLUMNS:
            self.texts[name] = str(value)
        elif isinstance(value, str):
            raise LogError(f"{self.path}: log.yaml gives the text {value!r} for the number {name}")
        else:
            self.numbers[name] = _FACTORS[self.stream.units.get(name, "m")](float(value))

    def _rows(self) -> Iterator[Row]:
        lines = iter(self._lines)
        for _, line in lines:
            if line:
                break
        stamp_place = self.places.get("stamp")
        stamp_unit = self.stream.units.get("stamp", "s")
        open_ended = self.stream.kind == "scan"
        least = self.first_range if open_ended else self._width
        count = 0
        for number, line in lines:
            if not line.strip():
                continue
            fields = _split(line, self.stream.delimiter)
            if fields is None:
                self._skip("undecodable", number)
                continue
            if len(fields) < least or (len(fields) > self._width and not open_ended):
                self._skip("wrong_number_of_fields", number)
                continue
            if stamp_place is None:
                stamp: int | None = self._start_ns + count * self._period_ns
                count += 1
            else:
                stamp = parse_stamp(fields[stamp_place], stamp_unit)
            if stamp is None or stamp >= END_NS:
                self._skip("bad_stamp", number)
                continue
            yield Row(self, number, stamp, fields)

    def _groups(self) -> Iterator[list[Row]]:
        """Rows that make up one event: of tags, those of one stamp and antenna; else each row by itself."""
        if self.stream.kind != "tags":
            for row in self._rows():
                yield [row]
            return
        group: list[Row] = []
        for row in self._rows():
            same = group and (row.stamp_ns, row.text("antenna")) == (
                group[0].stamp_ns,
                group[0].text("antenna"),
            )
            if not same or not row.text("tag_id") or not group[0].text("tag_id"):
                if group:
                    yield group
                group = []
            group.append(row)
        if group:
            yield group

    def _skip(self, reason: str, line: int) -> None:
        if self._counting:
            self._message_counts.skip(self.stream.kind, reason, f"{self.path.name} line {line}")


def inside(folder: Path, name: str) -> Path | None:
    """The path of a file named inside a log, or None where it leads out of the folder, links included."""
    path = folder / name
    try:
        resolved = path.resolve()
    except (OSError, RuntimeError, ValueError):
        return None
    return resolved if resolved.is_relative_to(folder.resolve()) else None


def _split(line: bytes, delimiter: str) -> list[str] | None:
    """Fields of a line, or None where it is not text."""
    try:
        text = line.decode()
    except UnicodeDecodeError:
        return None
    if '"' not in text:
        return text.split(delimiter)
    try:
        return next(csv.reader([text], delimiter=delimiter), [])
    except csv.Error:
        return None
