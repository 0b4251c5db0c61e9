"""Maps in the format of nav2's map_server: a YAML file and a grey image.

The formulas are those of nav2_map_server's `map_io.cpp` (the releases with `>=` thresholds, in which a pixel that is not opaque
is unknown), with these differences. Grey 205 of a map saver's image is unknown for any free_thresh. Thresholds outside [0, 1] are
refused. The origin is written with full precision (nav2: three decimals). The brightness of a
coloured pixel is the mean of its channels, as in the older releases. Scale mode is written with the thresholds 1 and 0 by
default, because other thresholds do not preserve the graded values.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import ConfigError, MapError
from gridslam.core.files import partial_file, put_file, real_path
from gridslam.maps.image_levels import MAX_PIXELS, ImageLevels, read_levels
from gridslam.maps.map_yaml import MapYaml, Mode, read_map_yaml
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

logger = logging.getLogger(__name__)

PIXEL_OCCUPIED, PIXEL_FREE, PIXEL_UNKNOWN = 0, 254, 205
TRINARY_THRESHOLDS = (0.65, 0.196)
SCALE_THRESHOLDS = (1.0, 0.0)
UNKNOWN = -1
SPIKE_RATIO = 10  # grey 205 means unknown if it is this much more frequent than 204 and 206 together
PROBABILITY_OF_CELL = np.append(np.arange(101, dtype=np.float32) / np.float32(100), np.float32(np.nan))
MIN_ODD_RESOLUTION_M = 1.0  # resolution from which another unit is likely
ROWS_PER_BLOCK = 64  # of a table lookup, whose indices take 8 bytes a pixel

ImageFormat = Literal["pgm", "png", "bmp"]


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Smallest occupancy (0 to 1) of an occupied cell, and largest of a free one.

    Raises ConfigError: not 0 <= free < occupied <= 1.
    """

    occupied: float
    free: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.free < self.occupied <= 1.0:
            raise ConfigError(
                f"map thresholds: free {self.free:g}, occupied {self.occupied:g}; "
                "expected 0 <= free < occupied <= 1"
            )


def load_map(
    yaml_path: str | Path, *, inside_folder: bool = False, max_cells: int = MAX_PIXELS
) -> OccupancyGrid:
    """The map of a map_server YAML; probability = nav2's cell value / 100, NaN for unknown cells.

    The image's path is relative to the YAML. As in nav2, absolute paths and `..` are followed, unless `inside_folder` is set
    (maps that come with a log).

    Raises MapError: a file is missing or damaged, a key is missing, a value is invalid, the image is too large or outside the
    folder.
    """
    path = Path(yaml_path)
    meta = read_map_yaml(path)
    image_path = path.parent / meta.image
    if inside_folder and not real_path(image_path).is_relative_to(real_path(path.parent)):
        raise MapError(f"{path}: image {meta.image!r} lies outside the map's folder; put it beside the YAML")
    cells = _cells_in(path, meta, read_levels(image_path, max_cells))
    probability = _looked_up(PROBABILITY_OF_CELL, cells)  # -1, unknown, is the last entry
    return OccupancyGrid(probability, GridGeometry(meta.resolution_m, meta.origin_xy_m, meta.origin_yaw_rad))


def _cells_in(path: Path, meta: MapYaml, image: ImageLevels) -> NDArray[np.int8]:
    """nav2's cell values of a map's image, with those of grey 205 unknown if it is a map saver's and its YAML makes them free.

    Map savers write 205 for unknown cells. With a free_thresh of 0.25, which old savers wrote beside it, or in scale mode, a
    robot that must not enter unknown cells would drive out of the building. Cells of grey 205 that are occupied get a warning.
    """
    _warn_about_unusual_values(path, meta, image)
    cells = cells_of_image(image, meta.mode, meta.occupied_thresh, meta.free_thresh, meta.negate)
    if meta.mode == "raw":
        return cells
    is_grey = (image.levels == _level(PIXEL_UNKNOWN, image))[::-1] & ((cells == 0) | (cells == 100))
    count = int(np.count_nonzero(is_grey))
    neighbours = [_level(PIXEL_UNKNOWN + step, image) for step in (-1, 1)]
    if count <= SPIKE_RATIO * sum(int(np.count_nonzero(image.levels == level)) for level in neighbours):
        return cells  # a graded image, in which 205 is a grey value like any other, or no such cell
    if meta.negate or (cells[is_grey] > 0).any():
        logger.warning(
            "%s: %d cells of grey 205, which map savers write for unknown, are not unknown with negate %d and occupied_thresh "
            "%g; map savers write negate: 0 and occupied_thresh: 0.65",
            path,
            count,
            meta.negate,
            meta.occupied_thresh,
        )
        return cells
    logger.warning(
        "%s: %d cells of grey 205 are read as unknown, as map savers mean it, although mode %s with free_thresh %g makes them "
        "free; set mode: trinary and free_thresh: 0.196",
        path,
        count,
        meta.mode,
        meta.free_thresh,
    )
    cells[is_grey] = UNKNOWN
    return cells


def _warn_about_unusual_values(path: Path, meta: MapYaml, image: ImageLevels) -> None:
    """Warn about values that map_server accepts, but that are probably mistakes."""
    if abs(meta.origin_yaw_rad) > 2.0 * np.pi:
        logger.warning(
            "%s: origin: the yaw %g is read as radians; if it is in degrees, write %.4g",
            path,
            meta.origin_yaw_rad,
            np.deg2rad(meta.origin_yaw_rad),
        )
    if meta.resolution_m >= MIN_ODD_RESOLUTION_M:
        logger.warning(
            "%s: resolution: %g metres a cell; if it is in cells a metre or in millimetres, write %.4g or %.4g",
            path,
            meta.resolution_m,
            1.0 / meta.resolution_m,
            1e-3 * meta.resolution_m,
        )
    if meta.mode != "raw":
        if image.translucent:
            logger.warning(
                "%s: %d cells are unknown because their pixels have an alpha between 0 and 255; "
                "save the image without an alpha channel",
                path,
                image.translucent,
            )
        return
    walls = int(np.count_nonzero(image.levels == _level(PIXEL_OCCUPIED, image)))
    others = (int(np.count_nonzero(image.levels == _level(p, image))) for p in (PIXEL_UNKNOWN, PIXEL_FREE))
    if walls and walls + sum(others) == image.levels.size:
        logger.warning(
            "%s: mode raw makes %d cells of grey 0 free, which map savers write for occupied; set mode: trinary",
            path,
            walls,
        )


def _level(pixel: int, image: ImageLevels) -> int:
    """The level of a pixel value from 0 to 255."""
    return round(pixel / 255 * image.maximum)


def cells_of_image(
    image: ImageLevels, mode: Mode, occupied_thresh: float, free_thresh: float, negate: bool
) -> NDArray[np.int8]:
    """nav2's cell values (0 to 100, -1 unknown) `(rows, cols)` of an image, the lower-left cell first."""
    brightness = np.arange(image.maximum + 1) / image.maximum
    table = _raw_cells(brightness)
    if mode != "raw":
        table = _threshold_cells(
            brightness if negate else 1.0 - brightness, occupied_thresh, free_thresh, graded=mode == "scale"
        )
    top_first = _looked_up(table.astype(np.int8), image.levels)
    if mode != "raw" and image.opaque is not None:
        top_first[~image.opaque] = UNKNOWN
    return top_first[::-1]


def _looked_up(table: NDArray[Any], index: NDArray[Any]) -> NDArray[Any]:
    """table[index] of an image `(rows, cols)`, in blocks of rows; bytes are looked up by OpenCV, ten times as fast."""
    if index.dtype.itemsize == 1:
        import cv2

        of_byte = np.full(256, table[-1])  # index -1 is byte 255
        of_byte[: len(table)] = table
        return np.asarray(cv2.LUT(np.ascontiguousarray(index).view(np.uint8), of_byte))
    found = np.empty(index.shape, table.dtype)
    for first in range(0, len(index), ROWS_PER_BLOCK):
        rows = slice(first, first + ROWS_PER_BLOCK)
        found[rows] = table[index[rows]]
    return found


def _threshold_cells(
    occupancy: NDArray[np.float64], occupied_thresh: float, free_thresh: float, graded: bool
) -> NDArray[np.int8]:
    between = np.full(occupancy.shape, float(UNKNOWN))
    if graded:
        span = occupied_thresh - free_thresh
        between = np.clip(np.rint((occupancy - free_thresh) / span * 100.0), 0.0, 100.0)
    cells = np.where(occupancy >= occupied_thresh, 100.0, between)
    return np.where(occupancy <= free_thresh, 0.0, cells).astype(np.int8)


def _raw_cells(brightness: NDArray[np.float64]) -> NDArray[np.int8]:
    value = np.rint(brightness * 255.0)
    return np.where(value <= 100.0, value, float(UNKNOWN)).astype(np.int8)


def save_map(
    grid: OccupancyGrid,
    base_path: str | Path,
    mode: Mode = "trinary",
    *,
    occupied_thresh: float | None = None,
    free_thresh: float | None = None,
    image_format: ImageFormat | None = None,
) -> Path:
    """Write a map as `base_path`.yaml and its image, and return the YAML's path.

    `image_format` is pgm or png; without it .pgm, or .png in scale mode. In trinary mode `occupied_thresh` and `free_thresh`
    (probabilities, default 0.65 and 0.196) classify the cells; the YAML has 0.65 and 0.196, which belong to the
    three pixel values. In scale mode (default 1 and 0) the YAML has the given thresholds. Both files are there, or neither: an
    older pair is replaced when the new one is complete.

    Raises ConfigError: thresholds out of order, an empty map, or unknown cells in a scale image without an alpha channel.
    """
    defaults = SCALE_THRESHOLDS if mode == "scale" else TRINARY_THRESHOLDS
    limits = Thresholds(
        defaults[0] if occupied_thresh is None else occupied_thresh,
        defaults[1] if free_thresh is None else free_thresh,
    )
    kind = image_format or ("png" if mode == "scale" else "pgm")
    base = Path(base_path)
    image_path = base.with_name(f"{base.name}.{kind}")
    yaml_path = base.with_name(f"{base.name}.yaml")
    if not grid.probability.size:
        raise ConfigError("an empty map (no rows or no columns) cannot be saved")
    pixel_of_value = _pixel_of_value(mode, limits)
    written = Thresholds(*TRINARY_THRESHOLDS) if mode == "trinary" else limits
    with partial_file(image_path) as image, partial_file(yaml_path) as text:
        if mode != "scale" and kind == "pgm":
            image.writelines(_pgm_pieces(grid, pixel_of_value))
        else:
            image.write(_image_bytes(cells_of_grid(grid)[::-1], pixel_of_value, mode, kind))
        text.write(_yaml_text(image_path.name, mode, grid.geometry, written).encode())
        for stream in (image, text):
            stream.flush()  # a full disk is noticed before anything is replaced
        put_file(image, image_path)
        put_file(text, yaml_path)
    return yaml_path


def cells_of_grid(grid: OccupancyGrid) -> NDArray[np.int8]:
    """nav2's cell values `(rows, cols)` of a grid: whole percent, -1 for unknown cells.

    Raises ValueError: a probability lies outside [0, 1].
    """
    cells = np.empty(grid.probability.shape, np.int8)
    for first in range(0, len(cells), ROWS_PER_BLOCK):
        block = slice(first, first + ROWS_PER_BLOCK)
        cells[block] = _cells_of(grid.probability[block])
    return cells


def _cells_of(probability: NDArray[np.floating]) -> NDArray[np.int8]:
    known = ~np.isnan(probability)
    percent = np.where(known, probability, 0.0) * 100.0
    if percent.size and not (percent.min() >= 0.0 and percent.max() <= 100.0):
        raise ValueError("an occupancy probability lies outside [0, 1]")
    return np.where(known, np.rint(percent), float(UNKNOWN)).astype(np.int8)


def _pgm_pieces(grid: OccupancyGrid, pixel_of_value: NDArray[np.uint8]) -> Iterator[bytes]:
    """A PGM file in blocks of rows, the top one first: of a large map no copy is made."""
    rows, cols = grid.probability.shape
    yield b"P5\n%d %d\n255\n" % (cols, rows)
    top_first = grid.probability[::-1]
    for first in range(0, rows, ROWS_PER_BLOCK):
        cells = _cells_of(top_first[first : first + ROWS_PER_BLOCK])
        yield pixel_of_value[cells].tobytes()


def _image_bytes(
    top_first: NDArray[np.int8], pixel_of_value: NDArray[np.uint8], mode: Mode, kind: ImageFormat
) -> bytes:
    """The picture of cell values, top row first."""
    image = Image.fromarray(_looked_up(pixel_of_value, top_first))
    if mode == "scale" and kind == "png":
        image.putalpha(Image.fromarray(np.where(top_first == UNKNOWN, np.uint8(0), np.uint8(255))))
        image = image.convert("RGBA")
    elif mode == "scale" and (top_first == UNKNOWN).any():
        raise ConfigError(
            f"a scale map with unknown cells needs an alpha channel, which {kind} lacks: use png"
        )
    buffer = io.BytesIO()
    image.save(buffer, format={"pgm": "PPM", "png": "PNG", "bmp": "BMP"}[kind])
    return buffer.getvalue()


def _pixel_of_value(mode: Mode, limits: Thresholds) -> NDArray[np.uint8]:
    """The pixel `(102,)` of the cell values 0 to 100, and of an unknown cell, -1, at the end."""
    value = np.arange(101.0)
    if mode == "trinary":
        pixels = np.where(value >= np.rint(limits.occupied * 100.0), PIXEL_OCCUPIED, PIXEL_UNKNOWN)
        pixels = np.where(value <= np.rint(limits.free * 100.0), PIXEL_FREE, pixels)
        unknown = PIXEL_UNKNOWN
    elif mode == "scale":
        pixels, unknown = np.rint((100.0 - value) / 100.0 * 255.0), 128
    else:
        pixels, unknown = value, 255
    return np.append(pixels, unknown).astype(np.uint8)


def _yaml_text(image_name: str, mode: Mode, geometry: GridGeometry, limits: Thresholds) -> str:
    origin = ", ".join(_decimal(v) for v in (*geometry.origin_xy_m, geometry.yaw_rad))
    return (
        yaml.safe_dump({"image": image_name}, allow_unicode=True)
        + f"mode: {mode}\nresolution: {_decimal(geometry.resolution_m)}\norigin: [{origin}]\nnegate: 0\n"
        + f"occupied_thresh: {_decimal(limits.occupied)}\nfree_thresh: {_decimal(limits.free)}\n"
    )


def _decimal(value: float) -> str:
    """The shortest decimal that reads back as the same float64, without an exponent: YAML 1.1 reads 1e-05 as text."""
    return str(np.format_float_positional(value, unique=True, trim="0"))
