"""Pictures of drawings: decoded upright, reduced if they are large photographs, and turned into brightness.

Arrays have the top row first.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import PICTURE_DAMAGE, MapError
from gridslam.maps.image_levels import check_header

Levels = NDArray[np.uint8]

MAX_PIXELS = 16_000_000
MIN_SIDE_PX = 16
PHOTOGRAPH_SIDE_PX = 1600  # a photograph's longer side, to which it is reduced
FORMATS = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "PPM")

ORIENTATION_TAG = 0x0112  # EXIF
# What makes a picture upright, by EXIF orientation; 1 is upright already.
UPRIGHT = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
# In a painted picture at least this fraction of the pixels has one of its 8 most frequent levels; a photograph has noise.
PAINTED_LEVELS, PAINTED_RATIO = 8, 0.85
STRONG_COLOUR = 60  # smallest difference between the channels of a coloured stroke, once the paper is white
MIN_COLOURED_RATIO = 0.001  # with a smaller fraction of coloured pixels the drawing counts as grey
DRAWN_ALPHA = 0.5  # opacity above which a pixel belongs to a stroke
# Smallest fraction of transparent pixels around strokes; with less, the opaque ones are the sheet
MIN_OPEN_RATIO = 0.05
MIDDLE_LEVEL = 127.0  # levels above are bright


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Brightness `(rows, cols)` or colours `(rows, cols, 3)`; a large photograph is reduced.

    Raises MapError if it is no picture, too large or too small.
    """
    try:
        check_header(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns about sizes and unusual palettes
            with Image.open(path, formats=FORMATS) as image:
                _check_size(path, *image.size)
                pixels = _pixels(image)
                return _reduced(_upright(pixels, image))
    except Image.DecompressionBombError:
        raise MapError(f"{path}: the drawing has more than {MAX_PIXELS} pixels; draw it smaller") from None
    except (FileNotFoundError, IsADirectoryError, PermissionError) as error:
        raise MapError(f"{path}: {error.strerror}") from None
    except PICTURE_DAMAGE as error:
        raise MapError(f"{path}: not a readable picture ({error}); save the drawing as PNG or JPEG") from None


def is_photograph(pixels: NDArray[np.uint8]) -> bool:
    """Whether pixels, `(rows, cols)` grey or `(rows, cols, 3)` RGB, are a photograph: of more levels than a drawn picture."""
    grey = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    counts = np.sort(np.bincount(grey.ravel(), minlength=256))
    return bool(counts[-PAINTED_LEVELS:].sum() < PAINTED_RATIO * grey.size)


def brightness_of(pixels: NDArray[np.uint8]) -> Levels:
    """Brightness `(rows, cols)`. Coloured strokes count as dark on bright paper, and as bright on dark paper."""
    if pixels.ndim == 2:
        return pixels
    grey = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), np.uint8)
    paper = np.median(pixels.reshape(-1, 3)[:: max(pixels.size // 300_000, 1)], axis=0)
    gains = max(float(paper.max()), 1.0) / np.maximum(paper, 1.0)
    balanced = pixels.astype(np.float32) * gains.astype(np.float32)
    low, high = balanced.min(axis=2), np.minimum(balanced.max(axis=2), 255.0)
    if (cv2.medianBlur(high - low, 3) > STRONG_COLOUR).mean() < MIN_COLOURED_RATIO:
        return grey
    return np.asarray(np.rint(low if np.median(grey) > 127.0 else high).astype(np.uint8))


def _check_size(path: Path, width: int, height: int) -> None:
    if min(width, height) < MIN_SIDE_PX:
        raise MapError(
            f"{path}: {width} x {height} pixels are too small for a drawing; at least {MIN_SIDE_PX} per side are needed"
        )
    if width * height > MAX_PIXELS:
        raise MapError(
            f"{path}: {width} x {height} pixels, at most {MAX_PIXELS} are read; scale the drawing down"
        )


def _pixels(image: Image.Image) -> NDArray[np.uint8]:
    """Brightness of a grey opaque picture, stretched to 0..255 if it has more than 8 bits; colours of any other.

    Transparent pixels are paper.
    """
    if image.mode.startswith(("I", "F")):
        return _stretched(np.asarray(image, dtype=np.float64))
    if image.mode in ("1", "L") and "transparency" not in image.info:
        return np.array(image.convert("L"))
    if "A" not in image.mode.upper() and "transparency" not in image.info:
        return np.array(image.convert("RGB"))
    return _on_paper(np.asarray(image.convert("RGBA")))


def _stretched(values: NDArray[np.float64]) -> Levels:
    """Levels from 0 to 255 between the smallest and the largest finite value of a grey picture with more than 8 bits."""
    known = values[np.isfinite(values)]
    low, high = float(known.min(initial=np.inf)), float(known.max(initial=-np.inf))
    if low > high:
        low = high = 0.0
    finite = np.nan_to_num(values, nan=low, posinf=high, neginf=low)
    scaled = (finite - low) * (255.0 / max(high - low, 1e-9))
    return np.asarray(np.rint(scaled).astype(np.uint8))


def _on_paper(rgba: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Colours `(rows, cols, 3)` of a partly transparent picture on paper: white, or black if the strokes are bright."""
    colours = np.ascontiguousarray(rgba[..., :3])
    grey = cv2.cvtColor(colours, cv2.COLOR_RGB2GRAY)
    alpha = rgba[..., 3].astype(np.float32) / np.float32(255.0)
    drawn = alpha > DRAWN_ALPHA
    is_open = (~drawn).mean() > MIN_OPEN_RATIO and drawn.any()
    strokes_are_bright = bool(is_open and np.median(grey[drawn]) > MIDDLE_LEVEL)
    paper = np.float32(0.0 if strokes_are_bright else 255.0)
    blended = colours * alpha[..., None] + paper * (1.0 - alpha[..., None])
    return np.asarray(np.rint(blended).astype(np.uint8))


def _upright(pixels: NDArray[np.uint8], image: Image.Image) -> NDArray[np.uint8]:
    """The pixels as a viewer shows them, rotated or mirrored by the EXIF orientation."""
    try:
        orientation = image.getexif().get(ORIENTATION_TAG)
    except (*PICTURE_DAMAGE, KeyError, TypeError, AttributeError, OverflowError):
        return pixels  # damaged EXIF data does not make the picture unreadable
    if not isinstance(orientation, int) or orientation not in UPRIGHT:
        return pixels
    return np.array(Image.fromarray(pixels).transpose(UPRIGHT[orientation]))


def _reduced(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    rows, cols = pixels.shape[:2]
    scale = PHOTOGRAPH_SIDE_PX / max(rows, cols)
    if scale >= 1.0 or not is_photograph(pixels):
        return pixels
    size = (max(round(cols * scale), MIN_SIDE_PX), max(round(rows * scale), MIN_SIDE_PX))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA))
