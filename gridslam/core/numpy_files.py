"""Numpy files (.npy, .npz): equal arrays are written to equal bytes, and damaged files are read safely."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Collection, Container, Iterable, Iterator
from contextlib import contextmanager
from typing import IO

import numpy as np
from numpy.typing import NDArray

COMPRESSION_LEVEL = 4
PIECE_BYTES = 1 << 20
MAX_HEADER_BYTES = 1 << 17  # largest header of an array, in version 1.0 of the format
MAX_PLAIN_BYTES = 1 << 30  # larger arrays need the zip format with 64 bits


@contextmanager
def damage_as_value_error() -> Iterator[None]:
    """Turn any error while a numpy file is read into a ValueError.

    numpy does not catch the errors of its parsers: zip, zlib, lzma, tokenize, compile, memory.
    """
    try:
        yield
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise ValueError(f"a damaged numpy file: {reason}") from error


def npz_bytes(arrays: Iterable[tuple[str, NDArray[np.generic]]], stored: Collection[str] = ()) -> bytes:
    """The content of an .npz file of named arrays, compressed one after the other; `numpy.load` reads it.

    Arrays whose names are `stored` hold compressed data and are kept as they are. The same arrays give the same bytes: all
    entries get the earliest date of the format.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=COMPRESSION_LEVEL) as archive:
        for name, values in arrays:
            entry = zipfile.ZipInfo(f"{name}.npy") if name in stored else f"{name}.npy"
            with archive.open(entry, "w", force_zip64=values.nbytes > MAX_PLAIN_BYTES) as file:
                _write_array(file, np.ascontiguousarray(values).reshape(values.shape))
            del values  # the next array is made while this one is referred to
    return buffer.getvalue()


def _write_array(file: IO[bytes], values: NDArray[np.generic]) -> None:
    """Write a C-contiguous array as a .npy file, a piece at a time: numpy's own writer copies 16 MB at once."""
    if values.dtype.hasobject:
        raise ValueError("objects are not written to numpy files")
    np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(values))
    content = values.reshape(-1).view(np.uint8)
    for first in range(0, len(content), PIECE_BYTES):
        file.write(content[first : first + PIECE_BYTES].data)


def read_npz(
    file: IO[bytes], max_bytes: int, names: Container[str] | None = None
) -> dict[str, NDArray[np.generic]]:
    """The arrays of an .npz file by name, or those that are named.

    Nothing is unpickled, and nothing is unpacked before its size is known. Raises ValueError: the file is damaged, or the
    arrays take more than `max_bytes`.
    """
    with damage_as_value_error():
        archive = zipfile.ZipFile(file)
        entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
    wanted = {name: entry for name, entry in entries.items() if names is None or name in names}
    size = sum(entry.file_size for entry in wanted.values())
    if size > max_bytes:
        raise ValueError(f"its arrays take {size} bytes; the limit is {max_bytes}")
    with damage_as_value_error():
        return {name: _array(_content(archive, entry)) for name, entry in wanted.items()}


def _content(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytearray:
    """The unpacked content of an entry, a piece at a time: the archive's own `read` takes twice its memory."""
    content = bytearray()
    with archive.open(entry) as file:
        while piece := file.read(PIECE_BYTES):
            content += piece
    return content


def _array(data: bytes | bytearray) -> NDArray[np.generic]:
    """The array of a .npy file, in the same memory. Raises ValueError: the header does not fit the data."""
    stream = io.BytesIO(data[:MAX_HEADER_BYTES])
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"version {version} of the format")
    shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError("an array of another type or size than its data")
    if not math.prod(shape):
        return np.empty(shape, dtype)
    return np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape, order="F" if is_fortran else "C")
