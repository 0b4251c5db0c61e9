"""Fields of CSV rows: numbers as the shortest text that reads back, names only where they read back."""

from __future__ import annotations

import math

import numpy as np

from gridslam.core.errors import LogError

_UNREADABLE = frozenset("\0\r\n")


def number_field(value: float) -> str:
    """The shortest text that gives the same float64 again; empty for NaN."""
    return "" if math.isnan(value) else repr(float(value))


def single_field(value: float) -> str:
    """The shortest text that gives the same float32 again."""
    return str(np.float32(value))


def name_field(value: str) -> str:
    """The name unchanged. Raises LogError for a name that would not read back: a line is a row, and fields are stripped."""
    if value.encode(errors="ignore").decode().strip() != value or not _UNREADABLE.isdisjoint(value):
        raise LogError(
            f"the name {value!r} cannot be written to a CSV file, which loses line breaks and blanks at the ends; "
            "name the output OUT.mcap"
        )
    return value
