"""Names of cameras, depths from their encodings, and pictures opened with care."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import PICTURE_DAMAGE
from gridslam.logs.skips import SkipReason, UnusableMessageError

MAX_PIXELS = 1 << 26  # largest camera image: 8192 x 8192
_LEAVES = frozenset(
    {
        "image",
        "image_raw",
        "image_rect",
        "image_color",
        "image_mono",
        "image_rect_color",
        "image_rect_raw",
        "compressedDepth",
        "compressed",
        "camera_info",
        "calibration",
        "color",
        "rgb",
        "depth",
        "aligned_depth_to_color",
        "disparity",
    }
)
DEPTH_ENCODINGS = frozenset({"16UC1", "32FC1"})


def camera_of(topic: str) -> str:
    """The camera that a topic belongs to: its path without the leading slash and the usual last parts."""
    parts = [p for p in topic.split("/") if p]
    while len(parts) > 1 and parts[-1] in _LEAVES:
        parts.pop()
    return "/".join(parts)


def depth_of(
    encoding: str, height: int, width: int, step: int, data: bytes, is_bigendian: bool
) -> NDArray[np.float32]:
    """Depths `(height, width)` (m) of a raw image, NaN where it has none.

    `encoding` 16UC1 or mono16: millimetres, 0 for none; 32FC1: metres. `step` is the length of a row of `data` in bytes,
    `is_bigendian` its byte order. Raises UnusableMessageError: another encoding. ValueError: too little
    data for the size.
    """
    order = ">" if is_bigendian else "<"
    if encoding in ("16UC1", "mono16"):
        raw = rows_of(data, height, used=2 * width, step=step).view(f"{order}u2")
        return np.where(raw == 0, np.float32(np.nan), raw.astype(np.float32) / np.float32(1000.0))
    if encoding == "32FC1":
        return rows_of(data, height, used=4 * width, step=step).view(f"{order}f4").astype(np.float32)
    raise UnusableMessageError(SkipReason.UNKNOWN_ENCODING, encoding)


@contextmanager
def opened_picture(data: bytes, formats: tuple[str, ...], max_pixels: int = MAX_PIXELS) -> Iterator[Any]:
    """A Pillow image whose size is checked before any pixel is unpacked.

    Raises ValueError: it is damaged, of another format or too large, whether that shows here or inside the block.
    """
    from PIL import Image as Pillow

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Pillow.DecompressionBombWarning)  # our own limit is lower
            with Pillow.open(io.BytesIO(data), formats=formats) as picture:
                if picture.width * picture.height > max_pixels:
                    raise ValueError(f"{picture.width} x {picture.height} pixels are too many")
                yield picture
    except (*PICTURE_DAMAGE, Pillow.DecompressionBombError) as error:
        raise ValueError(f"not a picture: {error}") from error


def rows_of(data: bytes, height: int, used: int, step: int) -> NDArray[np.uint8]:
    """The first `used` bytes `(height, used)` of each row of `step` bytes; the last row may end after them.

    Raises ValueError: there are fewer bytes.
    """
    if step < used or height <= 0 or used <= 0 or len(data) < step * (height - 1) + used:
        raise ValueError("image size and data disagree")
    step = step if height > 1 else used  # a message with a single row may state any step
    padded = np.frombuffer(data.ljust(step * height, b"\0"), np.uint8, step * height).reshape(height, step)
    return np.ascontiguousarray(padded[:, :used])
