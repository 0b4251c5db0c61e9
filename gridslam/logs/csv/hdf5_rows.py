"""Data sets of an HDF5 file as the lines of a table, which are then read as those of a CSV file are."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from gridslam.config.errors import short
from gridslam.core.errors import LogError
from gridslam.logs.csv_layout import CsvStream
from gridslam.logs.kinds import CSV_KINDS

MAX_DATASETS = 1000  # largest number of datasets of a file: more are not the log of a robot
# Unpacked bytes of the table for each byte of the file, and those that are read of any file. Constant columns pack best; a table
# of ranges reaches 10.
MAX_EXPANSION, ALWAYS_UNPACKED = 100, 4 << 20
MAX_ROW_BYTES = 1 << 20  # a scan of 131,072 ranges
# The parts in which a data set is packed are unpacked whole, and the last one of each column is kept.
MAX_CHUNK_BYTES, MAX_CHUNKS_BYTES = 1 << 26, 1 << 28
TEXT_EXPANSION = 16  # largest growth of numbers written as text: one of 16 bits takes up to 12 characters
BATCH_ROWS, BATCH_BYTES = 256, 1 << 20
TEXT_BATCH_ROWS = 16  # rows with strings read together; their length is known only when they are read
RANGES, PLAIN_RANGES = "r", "ranges"


@dataclass(frozen=True, slots=True)
class Column:
    """A data set of numbers or texts, or a `field` of one: its shape `(rows,)` or `(rows, n)` and the memory that it takes."""

    dataset: str
    field: str
    shape: tuple[int, ...]
    row_bytes: int
    chunk_bytes: int
    is_text: bool

    @property
    def names(self) -> int:
        """The number of columns; 0 for a data set of one dimension, which is one column of its name."""
        return (*self.shape, 0)[1]


Columns = dict[str, Column]


def import_h5py(path: Path) -> Any:
    """The library that reads HDF5. Raises LogError: it is not installed."""
    try:
        import h5py
    except ImportError:
        raise LogError(f"{path}: HDF5, which takes h5py to read: pip install 'gridslam[hdf5]'") from None
    return h5py


@contextmanager
def opened(path: Path, chunk_bytes: int = 0) -> Iterator[Any]:
    """The open file, which keeps that much of each data set unpacked. Raises LogError: it is damaged."""
    h5py = import_h5py(path)
    try:
        with h5py.File(path, "r", locking=False, rdcc_nbytes=max(chunk_bytes, 1 << 20)) as file:
            yield file
    except (OSError, RuntimeError, LookupError, ValueError, TypeError) as error:
        raise LogError(f"{path}: HDF5 that cannot be read ({short(error)})") from None


def columns_of(path: Path) -> Columns:
    """The data sets of numbers and texts with rows, by their path in the file; fields of compound types count as data sets.

    Raises LogError: the file cannot be read, or has too many of them.
    """
    h5py = import_h5py(path)
    found: Columns = {}

    def visit(name: str | bytes, item: Any) -> bool | None:
        if not isinstance(name, str) or not isinstance(item, h5py.Dataset):  # a name in bytes is not a string
            return None
        if item.shape and not (item.is_virtual or item.external):
            found.update(_fields(name, item))  # virtual and external ones lead out of the file
        return True if len(found) > MAX_DATASETS else None

    with opened(path) as file:
        file.visititems(visit)
    if len(found) > MAX_DATASETS:
        raise LogError(
            f"{path}: HDF5 with more than {MAX_DATASETS} data sets, which is not the log of a robot"
        )
    return found


def _fields(name: str, item: Any) -> Columns:
    """The columns of a data set."""
    try:
        whole = item.dtype
    except TypeError:  # a type that numpy does not have
        return {}
    chunk_bytes = math.prod(item.chunks or (0,)) * whole.itemsize
    found = {}
    for field in whole.names or ("",):
        dtype = whole[field] if field else whole
        shape = (*item.shape, *dtype.shape)
        is_text = dtype.kind == "O" and (dtype.metadata or {}).get("vlen") in (str, bytes)
        if len(shape) <= 2 and (is_text or dtype.base.kind in "biufS"):
            row_bytes = dtype.itemsize * math.prod(item.shape[1:])
            full = f"{name}/{field}" if field else name
            found[full] = Column(name, field, shape, row_bytes, chunk_bytes=chunk_bytes, is_text=is_text)
    return found


class Hdf5Rows:
    """Lines of text, the header first: of each row one, with the data sets below `stream.file` that have as many rows.

    A data set `NAME` of one column is the column NAME, one of several the columns NAME0, NAME1, ...
    """

    def __init__(self, path: Path, stream: CsvStream, columns: Columns) -> None:
        self._path = path
        root = stream.file.strip("/")
        below = {
            name.removeprefix(f"{root}/") if name != root else root.rsplit("/", 1)[-1]: name
            for name in columns
            if not root or name == root or name.startswith(f"{root}/")
        }
        if not below:
            raise LogError(f"{path}: no group or data set {stream.file!r}; it has: {described(columns)}")
        rows = {name: columns[full].shape[0] for name, full in below.items()}
        wanted = stream.columns.get("stamp", "stamp")
        if wanted not in rows:
            wanted = max(rows, key=lambda name: rows[name])
        self._count = rows[wanted]
        self._columns = {name: columns[full] for name, full in below.items() if rows[name] == self._count}
        self._limit = max(ALWAYS_UNPACKED, MAX_EXPANSION * path.stat().st_size)
        self._where = f"{path}: /{root}"
        self._check_size()

    def _check_size(self) -> None:
        """Raises LogError: the table takes more memory than its file can hold."""
        columns = self._columns.values()
        row_bytes = sum(column.row_bytes for column in columns)
        chunks = {column.dataset: column.chunk_bytes for column in columns}.values()
        self._chunk_bytes = max(chunks)
        if row_bytes > MAX_ROW_BYTES or self._chunk_bytes > MAX_CHUNK_BYTES or sum(chunks) > MAX_CHUNKS_BYTES:
            raise LogError(
                f"{self._where}: rows of {row_bytes} bytes in packed parts of {self._chunk_bytes} bytes; at most {MAX_ROW_BYTES} "
                f"and {MAX_CHUNK_BYTES} are read, and {MAX_CHUNKS_BYTES} for the parts of all columns together"
            )
        self._refuse_too_much(row_bytes * self._count)
        batch_rows = TEXT_BATCH_ROWS if any(column.is_text for column in columns) else BATCH_ROWS
        self._batch = max(1, min(batch_rows, BATCH_BYTES // max(row_bytes, 1)))

    def _refuse_too_much(self, size: int) -> None:
        """Raises LogError: no file of this size holds that many bytes."""
        if size > self._limit:
            raise LogError(
                f"{self._where}: unpacks to {size} bytes or more, far more than any file of this size"
            )

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """(row number from 0, line); the header is row 0. Raises LogError: the data are damaged."""
        yield 0, _line(chain.from_iterable(self._names(name) for name in self._columns))
        size = 0
        with opened(self._path, self._chunk_bytes) as file:
            for start in range(0, self._count, self._batch):
                rows = slice(start, min(start + self._batch, self._count))
                parts = [_table(_values(file, column, rows)) for column in self._columns.values()]
                for number, row in enumerate(zip(*parts, strict=True), start=start + 1):
                    line = _line(chain.from_iterable(row))
                    size += len(line)
                    yield number, line
                self._refuse_too_much(size // TEXT_EXPANSION)

    def _names(self, name: str) -> list[str]:
        width = self._columns[name].names
        return [f"{name}{place}" for place in range(width)] if width else [name]


def streams_of(path: Path, columns: Columns) -> list[CsvStream]:
    """The streams of a file without a layout: its groups that are named like kinds, with scalar attributes as constants.

    Raises LogError: it has none, or an attribute that must be a number is not.
    """
    kinds = [kind for kind in CSV_KINDS if any(name.startswith(f"{kind}/") for name in columns)]
    if not kinds:
        raise LogError(
            f"{path}: HDF5 without a group scan, odom or the like; its data sets are: {described(columns)}. Say what they are, "
            "for example: log: {csv: {streams: [{kind: scan, file: /, columns: {stamp: TIMES, r: RANGES}, constants: "
            "{angle_min: -1.57, angle_increment: 0.0087, range_min: 0.05, range_max: 30}}]}}"
        )
    with opened(path) as file:
        return [_stream_of(f"{path}: /{kind}", kind, file[kind].attrs, columns) for kind in kinds]


def _stream_of(where: str, kind: str, attributes: Any, columns: Columns) -> CsvStream:
    """The stream of a group. Raises LogError: an attribute is neither a text nor a finite number."""
    table = CSV_KINDS[kind]
    constants: dict[str, float | str] = {}
    for name in (*table.required, *table.optional):
        if name in attributes:
            constants[name] = _constant(f"{where}: attribute {name}", attributes[name])
    has_plain_name = f"{kind}/{PLAIN_RANGES}" in columns and f"{kind}/{RANGES}" not in columns
    renamed = {RANGES: PLAIN_RANGES} if table.has_ranges and has_plain_name else {}
    return CsvStream(kind=kind, file=kind, columns=renamed, constants=constants)


def _constant(where: str, value: Any) -> float | str:
    """The value of an attribute. Raises LogError: it is neither a text nor a finite number."""
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    if isinstance(value, str):
        return value
    if np.ndim(value) == 0 and np.asarray(value).dtype.kind in "biuf" and math.isfinite(value):
        return float(value)
    raise LogError(f"{where} is {short(value)}: expected a finite number or a text")


def described(columns: Columns) -> str:
    """The data sets and their shapes in words."""
    shown = [f"/{name} ({' x '.join(map(str, column.shape))})" for name, column in list(columns.items())[:12]]
    return ", ".join(shown) or "nothing"


def _values(file: Any, column: Column, rows: slice) -> Any:
    """Rows of a data set, or of a field of one."""
    dataset = file[column.dataset]
    return dataset.fields(column.field)[rows] if column.field else dataset[rows]


def _table(values: Any) -> list[list[Any]]:
    """The fields of each row."""
    listed = values.tolist()
    return listed if values.ndim == 2 else [[value] for value in listed]


def _line(fields: Any) -> bytes:
    texts = [field.decode(errors="replace") if isinstance(field, bytes) else str(field) for field in fields]
    if any("," in text or '"' in text or "\n" in text for text in texts):
        out = io.StringIO()
        csv.writer(out, lineterminator="").writerow(text.replace("\n", " ") for text in texts)
        return out.getvalue().encode(errors="replace")
    return ",".join(texts).encode(errors="replace")
