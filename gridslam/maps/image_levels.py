"""Brightness levels of a map image in PGM (P2, P5), PNG or BMP format."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import PICTURE_DAMAGE, MapError
from gridslam.core.plain_files import open_plain_file

MAX_PIXELS = 100_000_000  # 500 m x 500 m at 5 cm; a float32 map of that size takes 400 MB

DEEP_MAXIMUM = 65_535  # largest level of 16-bit grey
ROWS_AT_ONCE = 256  # rows of a large image that are converted together
MAX_HEADER_BYTES = 65_536  # largest header of a PGM that is read
_NUMBER = rb"(?:\s|#[^\r\n]*[\r\n])+\d+"
PNM_HEADER = re.compile(rb"P[14](?:%b){2}\s|P[2356](?:%b){3}\s" % (_NUMBER, _NUMBER))


@dataclass(frozen=True, slots=True)
class ImageLevels:
    """`levels` uint8 or uint16 `(rows, cols)`, top row first: mean of the colour channels = levels / maximum.

    `opaque` bool `(rows, cols)` is None for an image without an alpha channel; `translucent` is the number of pixels that are
    neither opaque nor fully transparent.
    """

    levels: NDArray[np.unsignedinteger[Any]]
    maximum: int
    opaque: NDArray[np.bool_] | None
    translucent: int = 0


def read_levels(path: Path, max_pixels: int = MAX_PIXELS) -> ImageLevels:
    """The levels of an image.

    Raises MapError: the image is missing, damaged, of another format, empty or too large.
    """
    try:
        if not path.is_file():
            raise MapError(f"{path}: no such image file; correct `image:` in the map's YAML")
        check_header(path)
        with warnings.catch_warnings():
            # Pillow warns at 89 million pixels; the check below has a limit of its own.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path, formats=("PPM", "PNG", "BMP")) as image:
                _check_size(path, image.size, max_pixels)
                return _levels(path, image)
    except Image.DecompressionBombError:  # beyond Pillow's own limit the size is not known
        raise MapError(
            f"{path}: too many pixels, at most {MAX_PIXELS} are read: crop the map or use coarser cells"
        ) from None
    except PICTURE_DAMAGE as error:
        raise MapError(
            f"{path}: not a readable PGM, PNG or BMP image ({error}); save the map again"
        ) from None


def check_header(path: Path) -> None:
    """Raise MapError for a PGM whose size and maximum lie behind comments without end: Pillow reads them byte by byte.

    Raises OSError: it cannot be read, or is a device or a pipe.
    """
    with open_plain_file(path) as file:
        head = file.read(MAX_HEADER_BYTES)
    is_cut = len(head) == MAX_HEADER_BYTES
    if is_cut and head.startswith(b"P") and not PNM_HEADER.match(head):
        raise MapError(
            f"{path}: no complete header of a PGM image in its first {MAX_HEADER_BYTES} bytes; save it again"
        )


def _check_size(path: Path, size: tuple[int, int], max_pixels: int) -> None:
    width, height = size
    if width < 1 or height < 1:
        raise MapError(f"{path}: the image is empty ({width} x {height} pixels)")
    if width * height > max_pixels:
        raise MapError(
            f"{path}: {width} x {height} pixels, at most {max_pixels} are read: "
            "crop the map or use coarser cells"
        )


def _levels(path: Path, image: Image.Image) -> ImageLevels:
    """The levels, made strip by strip: Pillow copies what it converts."""
    is_deep = image.mode.startswith("I")  # 16-bit grey; its pixel type differs between Pillow's releases
    if not is_deep and image.mode not in ("1", "L", "LA", "La", "P", "PA", "RGB", "RGBA", "RGBa"):
        raise MapError(
            f"{path}: pixels of type {image.mode!r} have no brightness from 0 to 255; save it as 8-bit grey"
        )
    has_alpha = not is_deep and ("A" in image.mode.upper() or "transparency" in image.info)
    is_grey = image.mode in ("1", "L") and not has_alpha
    maximum = DEEP_MAXIMUM if is_deep else 255 if is_grey else 765
    width, height = image.size
    levels = np.empty((height, width), np.uint8 if is_grey else np.uint16)
    opaque = np.empty((height, width), np.bool_) if has_alpha else None
    translucent = 0
    for first in range(0, height, ROWS_AT_ONCE):
        strip, rows = (
            image.crop((0, first, width, min(first + ROWS_AT_ONCE, height))),
            slice(first, first + ROWS_AT_ONCE),
        )
        if is_deep:
            levels[rows] = np.clip(np.asarray(strip), 0, maximum)
        elif is_grey:
            levels[rows] = np.asarray(strip.convert("L"))
        elif opaque is None:
            levels[rows] = np.asarray(strip.convert("RGB")).sum(axis=2, dtype=np.uint16)
        else:
            rgba = np.asarray(strip.convert("RGBA"))
            levels[rows] = rgba[..., :3].sum(axis=2, dtype=np.uint16)
            opaque[rows] = rgba[..., 3] == 255
            translucent += int(np.count_nonzero((rgba[..., 3] > 0) & ~opaque[rows]))
    return ImageLevels(levels, maximum, opaque, translucent)
