"""Limits for the size of results of methods in other packages, because writing them takes time and memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Sized

import numpy as np

from gridslam.methods.base import RunResult, Table

MAX_PARTS = 1000  # largest number of parts of one kind (files, layers, plots)
MAX_FACTS = 10_000  # counters, times and notes
MAX_MARKS = 100_000  # objects, loops and untrusted parts, which are drawn
MAX_VALUES = 10_000_000  # cells of all tables, poses of all trajectories, values of all series
MAX_MEASURES = 100_000  # mappings, lists and values in the measures
MAX_CHARACTERS = 1_000_000  # largest size of all notes together
MAX_BYTES = 1 << 30  # largest size of all files together

_PARTS = ("maps", "layers", "tables", "series", "pictures", "trajectories", "files")
_FACTS = ("counters", "timings_s", "notes")
_MARKS = ("objects", "loops_ns", "untrusted_ns")


def excesses(result: RunResult) -> Iterator[str]:
    """Parts of a result that are too many or too large to be written within seconds, in words that follow "the result"."""
    for kinds, limit in ((_PARTS, MAX_PARTS), (_FACTS, MAX_FACTS), (_MARKS, MAX_MARKS)):
        for kind in kinds:
            parts = getattr(result, kind)
            if isinstance(parts, Sized) and len(parts) > limit:
                yield f"has {len(parts)} {kind.removesuffix('_ns').removesuffix('_s')}; the limit is {limit}"
    sizes = {
        "cells in its tables": (sum(map(_cells_of, result.tables.values())), MAX_VALUES),
        "poses": (sum(map(len, (result.trajectory, *result.trajectories.values()))), MAX_VALUES),
        "values in its series": (sum(np.size(one.values) for one in result.series.values()), MAX_VALUES),
        "bytes in its files": (sum(map(len, result.files.values())), MAX_BYTES),
        "characters in its notes": (_characters_of(result.notes), MAX_CHARACTERS),
    }
    for what, (size, limit) in sizes.items():
        if size > limit:
            yield f"has {size} {what}; the limit is {limit}"
    if _has_more_than(MAX_MEASURES, result.measures):
        yield f"has more than {MAX_MEASURES} mappings, lists and values in its measures"


def _cells_of(table: Table) -> int:
    """Number of cells of a table; 0 if its rows or columns cannot be counted, which is reported otherwise."""
    if not isinstance(table.rows, Sized) or not isinstance(table.columns, Sized):
        return 0
    return len(table.rows) * len(table.columns)


def _characters_of(notes: object) -> int:
    return sum(len(note) for note in notes if isinstance(note, str)) if isinstance(notes, Sequence) else 0


def _has_more_than(limit: int, measures: object) -> bool:
    """Whether the measures have more values than the limit, as a mapping that contains itself has."""
    left, waiting = limit, [measures]
    while waiting and left >= 0:
        left -= 1
        one = waiting.pop()
        if isinstance(one, np.ndarray):
            left -= one.size
        elif isinstance(one, Mapping):
            waiting += one.values()
        elif isinstance(one, Sequence) and not isinstance(one, (str, bytes)):
            waiting += one
    return left < 0
