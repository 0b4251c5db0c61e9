"""Rows of a CSV table, read by our column names and in our units."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.files import real_path
from gridslam.core.messages import canonical_yaw
from gridslam.core.texts import parse_number, parse_numbers
from gridslam.logs.skips import SkipReason, UnusableMessageError


@dataclass(slots=True)
class TableColumns:
    """The columns of a table: their places, constants that hold for all rows, and the conversion of numbers to our units."""

    folder: Path
    frame: str = ""  # frame_id of rows that name none
    frame_column: str = "frame"
    naming_column: str = ""  # names the frame in rows where the column of the frame is empty
    child_frame: str = "base_link"
    places: dict[str, int] = field(default_factory=dict)  # our name -> field number
    texts: dict[str, str] = field(default_factory=dict)  # constants of text columns
    numbers: dict[str, float] = field(default_factory=dict)  # constants of numeric columns, in our units
    convert: dict[str, Callable[[float], float]] = field(default_factory=dict)
    number_places: tuple[int, ...] = ()  # field numbers of columns that hold a number each, ranges apart
    has_ranges: bool = False
    first_range: int = 0
    range_end: int | None = None
    range_divisor: float | None = None
    invalid: tuple[float, ...] = ()
    invalid_from: float | None = None
    frame_falls_back: bool = True  # whether rows that name no frame use the naming column

    def mark_invalid(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Set the readings `(beams,)`, in the file's unit, that mean no return to NaN; returns the same array."""
        for value in self.invalid:
            values[values == value] = np.nan
        if self.invalid_from is not None:
            values[values >= self.invalid_from] = np.nan
        return values

    def to_metres(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Ranges (m) of readings `(beams,)` in the file's unit."""
        return values if self.range_divisor is None else values / self.range_divisor

    def folder_file(self, name: str) -> Path:
        """The file that a row names. Raises UnusableMessageError: it is missing, or outside the log's folder."""
        path = path_inside(self.folder, name)
        if path is None:
            raise UnusableMessageError(SkipReason.FILE_OUTSIDE_FOLDER)
        if not path.is_file():
            raise UnusableMessageError(SkipReason.MISSING_FILE)
        return path


class Row:
    """One row: its line number, stamp and fields."""

    __slots__ = ("_columns", "_fields", "line", "stamp_ns")

    def __init__(self, columns: TableColumns, line: int, stamp_ns: int, fields: list[str]) -> None:
        self._columns = columns
        self._fields = fields
        self.line = line
        self.stamp_ns = stamp_ns

    @property
    def frame(self) -> str:
        """frame_id of the row's message."""
        columns = self._columns
        named = self.text(columns.frame_column)
        if named or not columns.frame_falls_back:
            return named or columns.frame
        return self.text(columns.naming_column) or columns.frame

    def text(self, name: str, default: str = "") -> str:
        """A text column; `default` where the column is missing or the field is empty."""
        place = self._columns.places.get(name)
        value = self._columns.texts.get(name, "") if place is None else self._fields[place].strip()
        return value or default

    def number(self, name: str, default: float | None = None) -> float:
        """A numeric column in our units; NaN for an empty field, unless there is a `default`.

        Raises ValueError: the field is not a number, or there is neither a column nor a constant nor a default.
        """
        place = self._columns.places.get(name)
        if place is None:
            constant = self._columns.numbers.get(name, default)
            if constant is None:
                raise ValueError(name)
            return constant
        field = self._fields[place]
        if not field.strip():
            return math.nan if default is None else default
        return self._columns.convert[name](parse_number(field))

    def yaw(self) -> float:
        """The column `yaw`, canonical and in (-pi, pi]."""
        yaw = self.number("yaw")
        if abs(yaw) > math.pi and math.isfinite(yaw):
            yaw = math.remainder(yaw, 2.0 * math.pi)
        return canonical_yaw(yaw)

    def ranges_m(self) -> NDArray[np.float64]:
        """Ranges `(beams,)` (m) of the range columns, without empty fields at the end; NaN for no return."""
        fields = self._fields[self._columns.first_range : self._columns.range_end]
        while fields and not fields[-1].strip():
            fields.pop()
        try:
            values = np.array(parse_numbers(fields))
        except ValueError:
            values = np.array([parse_number(f) if f.strip() else math.nan for f in fields])
        return self._columns.to_metres(self._columns.mark_invalid(values))

    def check_numbers(self) -> None:
        """Raises ValueError: a field of a numeric column is neither empty nor a number."""
        columns = self._columns
        for place in columns.number_places:
            if (field := self._fields[place]).strip():
                parse_number(field)
        if columns.has_ranges:
            ranges = self._fields[columns.first_range : columns.range_end]
            try:
                parse_numbers(ranges)
            except ValueError:
                parse_numbers([field for field in ranges if field.strip()])

    def is_marked_invalid(self, name: str) -> bool:
        """Whether the field, in the file's unit, is one of the table's codes for no return."""
        columns = self._columns
        if not columns.invalid and columns.invalid_from is None:
            return False
        raw = parse_number(self.text(name) or "nan") if name in columns.places else math.nan
        return math.isnan(float(columns.mark_invalid(np.array([raw]))[0]))

    def child_frame(self) -> str:
        """The column `child_frame`, else that of the table."""
        return self.text("child_frame", self._columns.child_frame)

    def file(self) -> Path:
        """The file that the column `file` names. Raises UnusableMessageError: missing, or outside the folder."""
        return self._columns.folder_file(self.text("file"))


def path_inside(folder: Path, name: str) -> Path | None:
    """The path of a file named inside a log, or None if it leads out of the folder, links included."""
    path = folder / name
    try:
        resolved = real_path(path)
    except (OSError, RuntimeError, ValueError):
        return None
    return resolved if resolved.is_relative_to(real_path(folder)) else None
