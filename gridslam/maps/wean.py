"""Reader of the map of Wean Hall from CMU's course on robot localization: a text file of 800 x 800 numbers.

Cells are 10 cm wide. A number is -1 for an unknown cell, else the probability that the cell is free (1 free, 0 occupied). The
file's first index is x and its second y: line k of the file is column k of the grid. Read the other way round the map is
mirrored, and no pose on it explains the scans of the logs.
"""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import numpy as np

from gridslam.core.errors import MapError
from gridslam.core.plain_files import open_plain_file
from gridslam.core.texts import parse_numbers
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

CELL_M = 0.1
MIN_CELLS, MAX_CELLS = 2, 4000
MAX_TEXT_BYTES = 256 << 20
_GZIP_MAGIC = b"\x1f\x8b"


def looks_like_wean_map(head: bytes) -> bool:
    """Whether the first bytes of a file, decompressed, are lines of several numbers that are -1 or between 0 and 1."""
    words = head.split(b"\n", 1)[0].split()
    if len(head) >= 2 and not head[-1:].isspace():
        words = words[:-1] if b"\n" not in head else words
    try:
        values = parse_numbers(words)
    except ValueError:
        return False
    return len(values) >= MIN_CELLS and all(v == -1.0 or 0.0 <= v <= 1.0 for v in values)


def load_wean_map(path: str | Path) -> OccupancyGrid:
    """The map of wean.dat or wean.dat.gz (of any size); its corner is the origin, x and y are those of the course's frame.

    Raises MapError: the file is missing, truncated or of another format; the message names the line.
    """
    path = Path(path)
    rows: list[list[float]] = []
    for number, line in enumerate(_text(path).splitlines(), start=1):
        if line.strip():
            rows.append(_row(path, number, line, len(rows[0]) if rows else None))
        if len(rows) > MAX_CELLS:
            raise MapError(
                f"{path}:{number}: more than {MAX_CELLS} lines; expected a map of Wean Hall's kind"
            )
    if len(rows) < MIN_CELLS:
        raise MapError(f"{path}: no map in it; expected lines of -1 (unknown) and 0 (occupied) to 1 (free)")
    free_by_xy = np.array(rows)
    probability = np.where(free_by_xy < 0.0, np.nan, 1.0 - free_by_xy).T
    return OccupancyGrid(
        np.ascontiguousarray(probability, dtype=np.float32), GridGeometry(CELL_M, (0.0, 0.0))
    )


def decompressed_head(path: Path, size: int = 4096) -> bytes:
    """The first bytes of a file, decompressed if it is gzipped; empty if it cannot be read."""
    try:
        with open_plain_file(path) as stream:
            packed = stream.read(2) == _GZIP_MAGIC
        with gzip.open(path) if packed else path.open("rb") as stream:
            return stream.read(size)
    except (OSError, EOFError, zlib.error):
        return b""


def _text(path: Path) -> str:
    if not path.is_file():
        raise MapError(f"{path}: no such map; give wean.dat or wean.dat.gz")
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == _GZIP_MAGIC
        with gzip.open(path) if packed else path.open("rb") as stream:
            data = stream.read(MAX_TEXT_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise MapError(f"{path}: cannot be read ({error}); copy the file again") from None
    if len(data) > MAX_TEXT_BYTES:
        raise MapError(
            f"{path}: more than {MAX_TEXT_BYTES >> 20} MB of text; expected a map of Wean Hall's kind"
        )
    try:
        return data.decode("ascii")
    except UnicodeDecodeError:
        raise MapError(f"{path}: not a text file; expected lines of numbers from -1 to 1") from None


def _row(path: Path, number: int, line: str, width: int | None) -> list[float]:
    try:
        values = parse_numbers(line.split())
    except ValueError as error:
        raise MapError(f"{path}:{number}: {error}; expected numbers from -1 to 1") from None
    if len(values) > MAX_CELLS or (width is not None and len(values) != width):
        expected = f"{width} as in the first line" if width is not None else f"at most {MAX_CELLS}"
        raise MapError(f"{path}:{number}: {len(values)} numbers; expected {expected} (is the file cut?)")
    if not all(v == -1.0 or 0.0 <= v <= 1.0 for v in values):
        raise MapError(f"{path}:{number}: a number is neither -1 nor between 0 and 1")
    return values
