"""Image files of a CSV folder: images in PNG or JPEG, depths in .npy (float32) or 16-bit PNG (mm)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.files import write_atomic
from gridslam.core.numpy_files import damage_as_value_error
from gridslam.logs.encoding.cameras import opened_picture
from gridslam.logs.encoding.image_encodings import unpacked
from gridslam.logs.skips import SkipReason, UnusableMessageError

_MAX_BYTES = 1 << 28
_MAX_FOLDER_NAME = 50  # characters of a camera; a file system takes 255 bytes


def read_pixels(path: Path) -> NDArray[np.uint8]:
    """Pixels of a PNG or JPEG, `(rows, cols)` grey or `(rows, cols, 3)` RGB. Raises UnusableMessageError: the file is none."""
    try:
        return unpacked(_bytes_of(path))
    except (OSError, ValueError) as error:
        raise UnusableMessageError(SkipReason.UNREADABLE_IMAGE) from error


def read_floats(path: Path) -> NDArray[np.float32]:
    """Depths (m) or disparities (pixels) `(rows, cols)` of a .npy file, or of a PNG in thousandths with 0 for none.

    Raises UnusableMessageError: the file is neither.
    """
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
        raise UnusableMessageError(SkipReason.UNREADABLE_IMAGE) from error


def _bytes_of(path: Path) -> bytes:
    """The content of a file. Raises ValueError: it is not a plain file (a pipe may never end), or too large."""
    if not path.is_file() or path.stat().st_size > _MAX_BYTES:
        raise ValueError("no file, or too large")
    return path.read_bytes()


class PictureWriter:
    """Writes pictures into subfolders of a log's folder, one for each kind and camera."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._last: dict[tuple[str, str], tuple[int, int]] = {}  # stamp and number, by subfolder and ending

    def write_pixels(self, kind: str, event: Any, pixels: NDArray[np.uint8]) -> str:
        """Write pixels, `(rows, cols)` grey or `(rows, cols, 3)` RGB, as a PNG; returns its name inside the log's folder."""
        from PIL import Image as Pillow

        buffer = io.BytesIO()
        Pillow.fromarray(np.ascontiguousarray(pixels)).save(buffer, format="PNG", compress_level=3)
        return self._write(kind, event, ".png", buffer.getvalue())

    def write_floats(self, kind: str, event: Any, values: NDArray[np.float32]) -> str:
        """Write values `(rows, cols)` as a .npy file of float32; returns its name inside the log's folder."""
        buffer = io.BytesIO()
        np.save(buffer, np.ascontiguousarray(values, dtype=np.float32), allow_pickle=False)
        return self._write(kind, event, ".npy", buffer.getvalue())

    def _write(self, kind: str, event: Any, suffix: str, data: bytes) -> str:
        camera = "".join(c if c.isalnum() or c in "-_" else "_" for c in event.camera) or "camera"
        folder = self._folder / f"{kind}_{camera[:_MAX_FOLDER_NAME]}"
        folder.mkdir(exist_ok=True)
        stamp_ns, number = self._last.get((folder.name, suffix), (-1, 0))
        number = number + 1 if stamp_ns == event.stamp_ns else 1
        while (folder / (name := _name(event.stamp_ns, number, suffix))).exists():
            number += 1
        self._last[folder.name, suffix] = event.stamp_ns, number
        write_atomic(folder / name, data)
        return f"{folder.name}/{name}"


def _name(stamp_ns: int, number: int, suffix: str) -> str:
    return f"{stamp_ns:019d}{suffix}" if number == 1 else f"{stamp_ns:019d}_{number}{suffix}"
