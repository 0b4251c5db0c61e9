"""Text tables of datasets: numbers by line, and stamps in nanoseconds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import LogError
from gridslam.core.messages import Event, Image, Odometry, canonical_yaw, readonly
from gridslam.core.stamps import parse_stamp
from gridslam.core.texts import is_number, parse_number
from gridslam.logs.datasets.source import DatasetStream
from gridslam.logs.encoding.csv_pictures import read_pixels
from gridslam.logs.encoding.csv_row import path_inside
from gridslam.logs.skips import SkipReason, UnusableMessageError
from gridslam.logs.stereo import is_raw

Floats = NDArray[np.float64]

MAX_BYTES = 1 << 28


def rows_of(path: Path, delimiter: str | None = None) -> list[list[str]]:
    """The fields of every line that is not a comment. Raises LogError: the file is too large, or is not text."""
    if path.stat().st_size > MAX_BYTES:
        raise LogError(f"{path}: larger than any table of a dataset")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise LogError(f"{path}: not a text file") from None
    kept = (line.strip() for line in lines)
    return [
        [field.strip() for field in line.split(delimiter)]
        for line in kept
        if line and not line.startswith("#")
    ]


def numbers_of(path: Path, rows: Sequence[Sequence[str]], count: int) -> Floats:
    """The rows as numbers `(n, count)`. Raises LogError: a row has other fields."""
    for place, row in enumerate(rows, start=1):
        if len(row) < count or not all(is_number(field) for field in row[:count]):
            found = " ".join(row)[:60]
            raise LogError(f"{path}: entry {place}: expected {count} numbers, found {found!r}")
    return np.array([[parse_number(field) for field in row[:count]] for row in rows], np.float64).reshape(
        -1, count
    )


def stamps_of(path: Path, texts: Sequence[str], unit: str) -> list[int]:
    """Stamps in nanoseconds. Raises LogError: one is not a stamp."""
    stamps = []
    for place, text in enumerate(texts, start=1):
        stamp = parse_stamp(text, unit)
        if stamp is None:
            raise LogError(f"{path}: entry {place}: {text[:40]!r} is not a stamp")
        stamps.append(stamp)
    return stamps


def inside(folder: Path, name: str) -> Path:
    """A file of the dataset. Raises UnusableMessageError: it is missing or outside the folder."""
    path = path_inside(folder, name)
    if path is None:
        raise UnusableMessageError(SkipReason.FILE_OUTSIDE_FOLDER)
    if not path.is_file():
        raise UnusableMessageError(SkipReason.MISSING_FILE)
    return path


def first_picture_size(folder: Path, name: str) -> tuple[int, int]:
    """Rows and columns of a sequence's first picture. Raises LogError: it cannot be read."""
    try:
        rows, cols = read_pixels(inside(folder, name)).shape[:2]
    except UnusableMessageError:
        raise LogError(f"{folder / name}: the first picture cannot be read") from None
    return rows, cols


def image_stream(
    folder: Path, camera: str, topic: str, stamps_ns: Sequence[int], names: Sequence[str]
) -> DatasetStream:
    """The pictures `names` in a folder, taken at `stamps_ns`; the topic says whether they are raw."""

    def event(k: int) -> Event:
        pixels = readonly(read_pixels(inside(folder, names[k])), np.uint8)
        return Image(stamps_ns[k], camera, pixels, camera, is_raw(topic))

    return DatasetStream("image", topic, camera, stamps_ns, event)


def single_event(kind: str, topic: str, frame: str, event: Event) -> DatasetStream:
    """A stream of one event."""
    return DatasetStream(kind, topic, frame, [event.stamp_ns], lambda _: event)


def truth_stream(stamps_ns: Sequence[int], poses: Floats) -> DatasetStream:
    """True poses `(n, 3)` in the plane."""

    def event(k: int) -> Event:
        x, y, yaw = poses[k].tolist()
        return Odometry(stamps_ns[k], "map", x, y, canonical_yaw(yaw))

    return DatasetStream("truth", "/ground_truth", "map", stamps_ns, event)


def in_plane(positions: Floats, forward: Floats) -> Floats:
    """Poses `(n, 3)` (x, y, yaw) of positions `(n, 3)` whose forward axes are `forward` `(n, 3)`, z up."""
    return np.column_stack([positions[:, :2], np.arctan2(forward[:, 1], forward[:, 0])])
