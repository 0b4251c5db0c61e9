"""Data sets of an HDF5 file as the lines of a table, which are then read as those of a CSV file are."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from gridslam.config.errors import short
from gridslam.core.errors import LogError
from gridslam.logs.csv_layout import CsvStream
from gridslam.logs.kinds import CSV_KINDS

MAX_DATASETS = 1000  # of a file: more are no log of a robot
MIN_ROWS = 10_000  # of a table in any case; beyond, one for each byte of the file
BATCH_ROWS = 256
RANGES, PLAIN_RANGES = "r", "ranges"


def import_h5py(path: Path) -> Any:
    """The library that reads HDF5. Raises LogError: it is not installed."""
    try:
        import h5py
    except ImportError:
        raise LogError(f"{path}: HDF5, which takes h5py to read: pip install 'gridslam[hdf5]'") from None
    return h5py


def datasets_of(path: Path) -> dict[str, tuple[int, ...]]:
    """The shape of each data set with rows, by its path in the file; fields of compound types count as data sets.

    Raises LogError: the file cannot be read.
    """
    h5py = import_h5py(path)
    found: dict[str, tuple[int, ...]] = {}

    def visit(name: str, item: Any) -> bool | None:
        leads_out = isinstance(item, h5py.Dataset) and (item.is_virtual or item.external)  # of the file
        if leads_out or not isinstance(item, h5py.Dataset):
            return None
        for field in item.dtype.names or ("",):
            shape = item.shape + (item.dtype[field].shape if field else ())
            if 1 <= len(shape) <= 2:
                found[f"{name}/{field}" if field else name] = shape
        return True if len(found) >= MAX_DATASETS else None

    try:
        with h5py.File(path, "r", locking=False) as file:
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise LogError(f"{path}: HDF5 that cannot be read ({short(error)})") from None
    return found


class Hdf5Rows:
    """Lines of text, the header first: of each row one, with the data sets below `stream.file` that have as many rows.

    A data set `NAME` of one column is the column NAME, one of several the columns NAME0, NAME1, ...
    """

    def __init__(self, path: Path, stream: CsvStream, datasets: dict[str, tuple[int, ...]]) -> None:
        self._path = path
        root = stream.file.strip("/")
        below = {
            name.removeprefix(f"{root}/") if name != root else root.rsplit("/", 1)[-1]: name
            for name in datasets
            if not root or name == root or name.startswith(f"{root}/")
        }
        if not below:
            raise LogError(f"{path}: no group or data set {stream.file!r}; it has: {described(datasets)}")
        rows = {name: datasets[full][0] for name, full in below.items()}
        wanted = stream.columns.get("stamp", "stamp")
        if wanted not in rows:
            wanted = max(rows, key=lambda name: rows[name])
        limit = max(MIN_ROWS, path.stat().st_size)
        self._count = min(rows[wanted], limit)
        self._columns = {name: full for name, full in below.items() if rows[name] == rows[wanted]}
        self._widths = {name: (*datasets[full], 0)[1] for name, full in self._columns.items()}

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """(row number from 0, line); the header is row 0."""
        yield 0, _line(chain.from_iterable(self._names(name) for name in self._columns))
        with import_h5py(self._path).File(self._path, "r", locking=False) as file:
            for start in range(0, self._count, BATCH_ROWS):
                rows = slice(start, min(start + BATCH_ROWS, self._count))
                parts = [_table(_values(file, full, rows)) for full in self._columns.values()]
                for number, row in enumerate(zip(*parts, strict=True), start=start + 1):
                    yield number, _line(chain.from_iterable(row))

    def _names(self, name: str) -> list[str]:
        width = self._widths[name]
        return [f"{name}{place}" for place in range(width)] if width else [name]


def streams_of(path: Path, datasets: dict[str, tuple[int, ...]]) -> list[CsvStream]:
    """The streams of a file without a layout: its groups that are named like kinds, with scalar attributes as constants."""
    kinds = [kind for kind in CSV_KINDS if any(name.startswith(f"{kind}/") for name in datasets)]
    if not kinds:
        raise LogError(
            f"{path}: HDF5 without a group scan, odom or the like; its data sets are: {described(datasets)}. Say what they are, "
            "for example: log: {csv: {streams: [{kind: scan, file: /, columns: {stamp: TIMES, r: RANGES}, constants: "
            "{angle_min: -1.57, angle_increment: 0.0087, range_min: 0.05, range_max: 30}}]}}"
        )
    with import_h5py(path).File(path, "r", locking=False) as file:
        return [_stream_of(kind, file[kind].attrs, datasets) for kind in kinds]


def _stream_of(kind: str, attributes: Any, datasets: dict[str, tuple[int, ...]]) -> CsvStream:
    table = CSV_KINDS[kind]
    known = {*table.required, *table.optional}
    numbers = {
        name: float(attributes[name])
        for name in attributes
        if name in known and np.ndim(attributes[name]) == 0
    }
    has_plain_name = f"{kind}/{PLAIN_RANGES}" in datasets and f"{kind}/{RANGES}" not in datasets
    columns = {RANGES: PLAIN_RANGES} if table.has_ranges and has_plain_name else {}
    return CsvStream(kind=kind, file=kind, columns=columns, constants=numbers)


def described(datasets: dict[str, tuple[int, ...]]) -> str:
    """The data sets and their shapes in words."""
    shown = [f"/{name} ({' x '.join(map(str, shape))})" for name, shape in list(datasets.items())[:12]]
    return ", ".join(shown) or "nothing"


def _values(file: Any, full: str, rows: slice) -> Any:
    """Rows of a data set, or of a field of one."""
    if full in file:
        return file[full][rows]
    name, _, field = full.rpartition("/")
    return file[name][rows][field]


def _table(values: Any) -> list[list[Any]]:
    """The fields of each row."""
    listed = values.tolist()
    return listed if values.ndim == 2 else [[value] for value in listed]


def _line(fields: Any) -> bytes:
    texts = [field.decode(errors="replace") if isinstance(field, bytes) else str(field) for field in fields]
    if any("," in text or '"' in text or "\n" in text for text in texts):
        out = io.StringIO()
        csv.writer(out, lineterminator="").writerow(text.replace("\n", " ") for text in texts)
        return out.getvalue().encode()
    return ",".join(texts).encode()
