"""Digests of what a run leaves behind: of the content, not of the names of files, keys and columns."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from PIL import Image

from gridslam.logs import open_log

# Pictures with labels, scale bars or legends; the maps and tables beside them hold the same content.
LABELLED_PICTURES = frozenset({"map.png", "objects.png", "exploration.png", "path.png"})
# Tables of seconds and megabytes, and settings with all their keys.
LEFT_OUT = LABELLED_PICTURES | {"costs.csv", "run.yaml", "world.yaml", "sweep.yaml"}


def digests_of_folder(folder: Path) -> dict[str, str]:
    """The digest of every file below a folder whose content must stay, by its path.

    A log also has the item `NAME events`: what gridslam's own reader plays back of it.
    """
    digests = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.name not in LEFT_OUT and path.suffix in CONTENT_OF:
            digests[name] = _digest(CONTENT_OF[path.suffix](path))
        if path.name.endswith((".mcap", "-csv")):
            digests[f"{name} events"] = _digest(log_events(path))
    return digests


def numbers(path: Path) -> Iterator[bytes]:
    """The numeric words of a text file as they are written, in order; lines stay apart."""
    for line in path.read_text().splitlines():
        yield b"\n"
        yield from (word.encode() + b" " for word in re.split(r"[\s,:\[\]{}]+", line) if _is_number(word))


def table(path: Path) -> Iterator[bytes]:
    """The numeric cells of a CSV table as they are written, in order, without the header."""
    with path.open(newline="") as stream:
        rows = csv.reader(stream)
        next(rows, None)
        for row in rows:
            yield b"\n"
            yield from (cell.encode() + b" " for cell in row if _is_number(cell))


def arrays(path: Path) -> Iterator[bytes]:
    """Type, shape and bytes of the arrays of an .npz file, whatever their names; those of text are left out."""
    with np.load(path, allow_pickle=False) as file:
        found = [file[name] for name in file.files]
    yield from sorted(_digest(value_bytes(array)).encode() for array in found if array.dtype.kind != "U")


def pixels(path: Path) -> Iterator[bytes]:
    """Mode, size and pixels of a picture."""
    with Image.open(path) as image:
        yield f"{image.mode} {image.size}".encode()
        yield image.tobytes()


def mcap_messages(path: Path) -> Iterator[bytes]:
    """Time and encoded bytes of the messages of an MCAP file, in the file's order, without topics and schemas."""
    with path.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages(log_time_order=False):
            yield f"{message.log_time} {len(message.data)} ".encode()
            yield message.data


def log_events(path: Path) -> Iterator[bytes]:
    """The values of every event of a log, in the order of its fields, without the names of fields and classes."""
    with open_log(path) as log:
        for event in log.events():
            yield b"\n"
            for field in (f for f in dataclasses.fields(event) if f.compare):
                yield from value_bytes(getattr(event, field.name))


def value_bytes(value: object) -> Iterator[bytes]:
    """An array's type, shape and bytes; the repr of anything else."""
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str} {value.shape} ".encode()
        yield np.ascontiguousarray(value).tobytes()
    else:
        yield repr(value).encode() + b" "


def file_bytes(path: Path) -> Iterator[bytes]:
    """A file as it is."""
    yield path.read_bytes()


CONTENT_OF: dict[str, Callable[[Path], Iterator[bytes]]] = {
    ".pgm": file_bytes,
    ".tum": file_bytes,
    ".npz": arrays,
    ".csv": table,
    ".yaml": numbers,
    ".png": pixels,
    ".npy": file_bytes,
    ".mcap": mcap_messages,
}


def _digest(parts: Iterator[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:32]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
