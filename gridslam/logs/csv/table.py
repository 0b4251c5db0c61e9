"""One CSV file as a stream: converts rows to events by the columns, units and constants of the layout."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.core.messages import Event
from gridslam.core.stamps import END_NS, NS_PER_S, parse_stamp
from gridslam.logs.csv_layout import CsvStream
from gridslam.logs.encoding.csv_row import Row, TableColumns
from gridslam.logs.kinds import CSV_KINDS
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import Skip, SkipReason, UnusableMessageError

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
_RANGE_DIVISORS = {"cm": 100.0, "mm": 1000.0}
_FRAME_COLUMNS = ("frame", "child_frame")  # texts in the tables of all kinds that have them
_MAX_FRAMES = 1000


class CsvTable:
    """A stream of one file. `index` comes first; `events` gives one entry per stamp of the index."""

    def __init__(
        self,
        folder: Path,
        path: Path,
        stream: CsvStream,
        message_counts: MessageCounts,
        lines: Iterable[tuple[int, bytes]],
    ) -> None:
        self.stream = stream
        self.path = path
        self._kind = CSV_KINDS[stream.kind]
        self._texts = frozenset((*self._kind.texts, *_FRAME_COLUMNS))
        self._columns = TableColumns(
            folder,
            frame=self._kind.default_frame if stream.frame is None else stream.frame,
            frame_column=self._kind.frame_column,
            naming_column=self._kind.naming_column,
            child_frame="base_link" if stream.child_frame is None else stream.child_frame,
            range_divisor=_RANGE_DIVISORS.get(stream.units.get("r", "m")),
            invalid=tuple(stream.invalid),
            invalid_from=stream.invalid_from,
            frame_falls_back=stream.frame is None,
        )
        self._message_counts = message_counts
        self._lines = lines
        self._is_indexing = False
        self._unreadable = array("q")  # lines where events begin that the index has found unreadable
        self._width = 0
        self._period_ns, self._start_ns = self._row_clock()
        self._read_header()

    def index(self) -> tuple[array[int], dict[str, None]]:
        """Stamps of all events and the frames in use; unreadable rows are counted."""
        stamps = array("q")
        frames: dict[str, None] = {}
        if not self._rows_have_frames():
            frames[self._columns.frame] = None
        self._is_indexing = True
        for rows in self._groups():
            try:
                for row in rows:
                    row.check_numbers()
            except ValueError:
                self._skip(SkipReason.UNREADABLE_ROW, rows[0].line)
                self._unreadable.append(rows[0].line)
                continue
            stamps.append(rows[0].stamp_ns)
            if self._rows_have_frames() and len(frames) < _MAX_FRAMES:
                frames[rows[0].frame] = None
        self._is_indexing = False
        return stamps, frames

    def events(self) -> Iterator[Event | Skip]:
        """One event, or the reason why there is none, per entry of the index."""
        unreadable = iter(self._unreadable)
        next_unreadable = next(unreadable, None)
        for rows in self._groups():
            if rows[0].line == next_unreadable:
                next_unreadable = next(unreadable, None)
            else:
                yield self._event(rows)

    def _event(self, rows: list[Row]) -> Event | Skip:
        where = f"{self.path.name} line {rows[0].line}"
        try:
            return self._kind.from_rows(rows)
        except UnusableMessageError as error:
            return Skip(error.reason, where)
        except (ValueError, OverflowError):
            return Skip(SkipReason.UNREADABLE_ROW, where)

    def edges(self) -> set[tuple[str, str]]:
        """The (parent, child) pairs of a table of transforms."""
        return {(row.text("parent"), row.text("child")) for row in self._rows()}

    def _rows_have_frames(self) -> bool:
        """Whether the frame may differ from row to row."""
        columns = self._columns
        if columns.frame_column in columns.places:
            return True
        return columns.frame_falls_back and self._kind.rows_name_frames and bool(columns.frame_column)

    def _row_clock(self) -> tuple[int, int]:
        clock = self.stream.row_stamps
        if clock is None:
            return 0, 0
        return round(clock.period_s * NS_PER_S), round(clock.start_s * NS_PER_S)

    def _read_header(self) -> None:
        header = next((line for _, line in self._lines if line), None)
        names = [] if header is None else _split(header, self.stream.delimiter)
        names = [] if names is None else [n.strip().removeprefix("\ufeff") for n in names]
        stream, kind, columns = self.stream, self._kind, self._columns
        self._width = len(names)
        needed = (() if stream.row_stamps else ("stamp",)) + kind.required
        for name in (*needed, *kind.optional, *(() if stream.row_stamps else ("stamp",))):
            column = stream.columns.get(name, name)
            if column in names:
                columns.places[name] = names.index(column)
                columns.convert[name] = _FACTORS[stream.units.get(name, "m")]
            elif name in stream.constants:
                self._add_constant(name, stream.constants[name])
            elif name in needed:
                raise LogError(
                    f"{self.path}: no column {column!r} for {name}; "
                    f"the header has: {', '.join(names[:20]) or 'nothing'}. "
                    f"Rename it in log.yaml: streams: - {{kind: {stream.kind}, file: {stream.file}, "
                    f"columns: {{{name}: COLUMN}}}}"
                )
        columns.number_places = tuple(
            place
            for name, place in columns.places.items()
            if name != "stamp" and name not in self._texts and name not in kind.lists
        )
        if kind.has_ranges:
            first = stream.columns.get("r", "r") + "0"
            if first not in names:
                raise LogError(f"{self.path}: no column {first!r} where the ranges begin")
            columns.has_ranges, columns.first_range = True, names.index(first)
            end = _end_of_ranges(names, columns.first_range, first.removesuffix("0"))
            columns.range_end = None if end == len(names) else end

    def _add_constant(self, name: str, value: float | str) -> None:
        if name in self._texts:
            self._columns.texts[name] = str(value)
        elif isinstance(value, str):
            raise LogError(f"{self.path}: log.yaml gives the text {value!r} for the number {name}")
        else:
            self._columns.numbers[name] = _FACTORS[self.stream.units.get(name, "m")](float(value))

    def _rows(self) -> Iterator[Row]:
        lines = iter(self._lines)
        for _, line in lines:
            if line:
                break
        stamp_place = self._columns.places.get("stamp")
        stamp_unit = self.stream.units.get("stamp", "s")
        open_ended = self._kind.has_ranges and self._columns.range_end is None
        min_width = max(self._columns.places.values(), default=0) + 1 if open_ended else self._width
        count = 0
        for number, line in lines:
            if not line.strip():
                continue
            fields = _split(line, self.stream.delimiter)
            if fields is None:
                self._skip(SkipReason.UNDECODABLE, number)
                continue
            if len(fields) < min_width or (len(fields) > self._width and not open_ended):
                self._skip(SkipReason.WRONG_NUMBER_OF_FIELDS, number)
                continue
            if stamp_place is None:
                stamp: int | None = self._start_ns + count * self._period_ns
                count += 1
            else:
                stamp = parse_stamp(fields[stamp_place], stamp_unit)
            if stamp is None or stamp >= END_NS:
                self._skip(SkipReason.BAD_STAMP, number)
                continue
            yield Row(self._columns, number, stamp, fields)

    def _groups(self) -> Iterator[list[Row]]:
        """The rows of each event: rows that the kind groups, else single rows."""
        if self._kind.groups is None:
            for row in self._rows():
                yield [row]
            return
        by, item = self._kind.groups
        group: list[Row] = []
        for row in self._rows():
            same = group and (row.stamp_ns, row.text(by)) == (group[0].stamp_ns, group[0].text(by))
            if not same or not row.text(item) or not group[0].text(item):
                if group:
                    yield group
                group = []
            group.append(row)
        if group:
            yield group

    def _skip(self, reason: SkipReason, line: int) -> None:
        if self._is_indexing:
            self._message_counts.skip(self.stream.kind, reason.value, f"{self.path.name} line {line}")


def _split(line: bytes, delimiter: str) -> list[str] | None:
    """Fields of a line, or None if it is not text (a file system that crashed leaves zeros)."""
    if b"\0" in line:
        return None
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


def _end_of_ranges(names: Sequence[str], start: int, prefix: str) -> int:
    """The index behind the last of consecutive columns r0, r1, ... from `start` on."""
    end = start
    while end < len(names) and names[end] == f"{prefix}{end - start}":
        end += 1
    return end
