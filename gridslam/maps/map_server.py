"""Maps in the format of nav2's map_server: a YAML file and a grey image.

The formulas are those of nav2_map_server's `map_io.cpp` (the releases with `>=` thresholds, in which a pixel that is not opaque
is unknown), with these differences:

* In an image from a map saver, grey 205 is unknown for any free_thresh.
* Thresholds outside [0, 1] are refused.
* The origin is written with full precision (nav2: three decimals).
* The brightness of a coloured pixel is the mean of its channels, as in older releases.
* Scale mode is written with the thresholds 1 and 0 by default, because others do not preserve the graded values.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import ConfigError, MapError
from gridslam.core.files import partial_file, put_file, real_path
from gridslam.maps.image_levels import MAX_PIXELS, ImageLevels, read_levels
from gridslam.maps.map_cells import (
    PIXEL_FREE,
    PIXEL_OCCUPIED,
    PIXEL_UNKNOWN,
    ROWS_PER_BLOCK,
    SCALE_THRESHOLDS,
    TRINARY_THRESHOLDS,
    UNKNOWN,
    Cells,
    Thresholds,
    cells_of_grid,
    cells_of_image,
    cells_of_probability,
    level_of_pixel,
    look_up,
    pixel_of_cell,
    probability_of_cells,
)
from gridslam.maps.map_yaml import MapYaml, Mode, read_map_yaml
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

logger = logging.getLogger(__name__)

SPIKE_RATIO = 10  # grey 205 means unknown if it is this many times as frequent as 204 and 206 together
MIN_ODD_RESOLUTION_M = 1.0  # resolution from which another unit is likely

ImageFormat = Literal["pgm", "png", "bmp"]


def load_map(
    yaml_path: str | Path, *, inside_folder: bool = False, max_cells: int = MAX_PIXELS
) -> OccupancyGrid:
    """The map of a map_server YAML. A probability is nav2's cell value / 100, or NaN for unknown cells.

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
    geometry = GridGeometry(meta.resolution_m, meta.origin_xy_m, meta.origin_yaw_rad)
    return OccupancyGrid(probability_of_cells(cells), geometry)


def _cells_in(path: Path, meta: MapYaml, image: ImageLevels) -> Cells:
    """nav2's cell values of an image, except that grey 205 in the image of a map saver is never free but unknown.

    Map savers write 205 for unknown cells. With the free_thresh of 0.25 that old savers wrote, or in scale mode, nav2 reads it as
    free, and a robot that must not enter unknown cells would drive out of the building. If 205 is occupied, there is only a
    warning.
    """
    _warn_about_unusual_values(path, meta, image)
    cells = cells_of_image(image, meta.mode, meta.occupied_thresh, meta.free_thresh, meta.negate)
    if meta.mode == "raw":
        return cells
    is_grey = (image.levels == level_of_pixel(PIXEL_UNKNOWN, image))[::-1] & ((cells == 0) | (cells == 100))
    count = int(np.count_nonzero(is_grey))
    neighbours = [level_of_pixel(PIXEL_UNKNOWN + step, image) for step in (-1, 1)]
    if count <= SPIKE_RATIO * sum(int(np.count_nonzero(image.levels == level)) for level in neighbours):
        return cells  # there is no such cell, or 205 is one of the greys of a graded image
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
    """Warn about values that map_server accepts but that are probably mistakes."""
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
    walls, unknown, free = (
        int(np.count_nonzero(image.levels == level_of_pixel(pixel, image)))
        for pixel in (PIXEL_OCCUPIED, PIXEL_UNKNOWN, PIXEL_FREE)
    )
    if walls and walls + unknown + free == image.levels.size:
        logger.warning(
            "%s: mode raw makes %d cells of grey 0 free, which map savers write for occupied; set mode: trinary",
            path,
            walls,
        )


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

    `image_format` is pgm, png or bmp (default: pgm, or png in scale mode). In trinary mode, `occupied_thresh` and `free_thresh`
    (probabilities, default 0.65 and 0.196) classify the cells; the YAML always has 0.65 and 0.196, which match the three pixel
    values. In the other modes the YAML has the given thresholds (default 1 and 0 in scale mode). An existing pair of files is
    replaced only when both new ones are complete.

    Raises ConfigError: the thresholds are out of order, the map is empty, or a scale image would need an alpha channel for
    unknown cells.
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
    pixels = pixel_of_cell(mode, limits)
    written = Thresholds(*TRINARY_THRESHOLDS) if mode == "trinary" else limits
    with partial_file(image_path) as image, partial_file(yaml_path) as text:
        if mode != "scale" and kind == "pgm":
            image.writelines(_pgm_pieces(grid, pixels))
        else:
            image.write(_image_bytes(cells_of_grid(grid)[::-1], pixels, mode, kind))
        text.write(_yaml_text(image_path.name, mode, grid.geometry, written).encode())
        for stream in (image, text):
            stream.flush()  # a full disk is noticed before anything is replaced
        put_file(image, image_path)
        put_file(text, yaml_path)
    return yaml_path


def _pgm_pieces(grid: OccupancyGrid, pixels: NDArray[np.uint8]) -> Iterator[bytes]:
    """A PGM file in pieces of a few rows, the top one first, so that a large map is not copied. `pixels` are by cell value."""
    rows, cols = grid.probability.shape
    yield b"P5\n%d %d\n255\n" % (cols, rows)
    top_first = grid.probability[::-1]
    for first in range(0, rows, ROWS_PER_BLOCK):
        cells = cells_of_probability(top_first[first : first + ROWS_PER_BLOCK])
        yield pixels[cells].tobytes()


def _image_bytes(top_first: Cells, pixels: NDArray[np.uint8], mode: Mode, kind: ImageFormat) -> bytes:
    """An image file of cell values, top row first. `pixels` are by cell value."""
    image = Image.fromarray(look_up(pixels, top_first))
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
