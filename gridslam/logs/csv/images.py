"""Picture files of a CSV folder: images in PNG or JPEG, depths in .npy (float32) or 16-bit PNG (mm)."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.files import write_atomic
from gridslam.core.numpy_files import damage_as_value_error
from gridslam.logs.cameras import opened_picture, unpack_picture

_MOST_BYTES = 1 << 28


def read_pixels(path: Path) -> NDArray[np.uint8]:
    """Grey or RGB pixels. ValueError("unreadable_image") where it is no picture."""
    try:
        return unpack_picture(_bytes_of(path))
    except (OSError, ValueError) as error:
        raise ValueError("unreadable_image") from error


def read_floats(path: Path) -> NDArray[np.float32]:
    """Depths in metres, or disparities in pixels. ValueError("unreadable_image") where it holds none."""
    try:
        data = _bytes_of(path)
        if data.startswith(b"\x93NUMPY"):
            with damage_as_value_error():
                values = np.load(io.BytesIO(data), allow_pickle=False)
        else:
            with opened_picture(data, ("PNG",)) as picture:
                raw = np.asarray(picture)
            values = np.where(raw == 0, np.nan, raw / 1000.0)
        if values.ndim != 2 or values.dtype.kind not in "fiu":
            raise ValueError("not a table of numbers")
        with np.errstate(over="ignore"):  # a double that is too large for a float32 is infinite
            return np.asarray(values, dtype=np.float32)
    except (OSError, ValueError, SyntaxError, EOFError, MemoryError) as error:
        raise ValueError("unreadable_image") from error


def _bytes_of(path: Path) -> bytes:
    """A plain file of sensible size: a pipe would be waited for without end."""
    if not path.is_file() or path.stat().st_size > _MOST_BYTES:
        raise ValueError("no file, or too large")
    return path.read_bytes()


def write_pixels(path: Path, pixels: NDArray[np.uint8]) -> None:
    """A PNG, without loss."""
    from PIL import Image as Pillow

    buffer = io.BytesIO()
    Pillow.fromarray(np.ascontiguousarray(pixels)).save(buffer, format="PNG", compress_level=3)
    write_atomic(path, buffer.getvalue())


def write_floats(path: Path, values: NDArray[np.float32]) -> None:
    """A .npy file of float32."""
    buffer = io.BytesIO()
    np.save(buffer, np.ascontiguousarray(values, dtype=np.float32), allow_pickle=False)
    write_atomic(path, buffer.getvalue())
