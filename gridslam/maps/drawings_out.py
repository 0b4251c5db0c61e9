"""Maps as drawings for other programs: walls as contours in SVG and DXF, cells as GeoTIFF."""

from __future__ import annotations

import io

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

from gridslam.core.errors import ConfigError, MapError
from gridslam.maps.editing import FREE_UP_TO, OCCUPIED_FROM
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]

SUBCELLS = 4  # of a contour: it lies this part of a cell inside the border of its cells
MAX_CONTOUR_CELLS = 25_000_000  # each of which is SUBCELLS^2 pixels while contours are found
MAX_CONTOUR_EDGES = 2_000_000
MAX_DEVIATION_CELLS = 0.4  # largest deviation of a contour with fewer corners
PIXEL_SCALE, TIE_POINT, TRANSFORMATION, GEO_KEYS = 33550, 33922, 34264, 34735
DOUBLE, SHORT = 12, 3


def wall_contours(grid: OccupancyGrid) -> list[Floats]:
    """Closed contours `(n, 2)` (m, map frame) of the occupied areas and of the holes in them.

    Raises MapError: the map is too large, or its contours are too long.
    """
    walls = np.pad(grid.probability > OCCUPIED_FROM, 1).view(np.uint8)
    if walls.size > MAX_CONTOUR_CELLS:
        raise MapError(
            f"contours are drawn of at most {MAX_CONTOUR_CELLS} cells; cut a part out of it with `gridslam maps crop`"
        )
    changes = int(np.count_nonzero(np.diff(walls, axis=0))) + int(np.count_nonzero(np.diff(walls, axis=1)))
    if changes > MAX_CONTOUR_EDGES:
        raise MapError(
            f"the contours of the walls have {changes} edges of cells, as noise has; the limit is {MAX_CONTOUR_EDGES}"
        )
    fine = cv2.resize(walls, None, fx=SUBCELLS, fy=SUBCELLS, interpolation=cv2.INTER_NEAREST)
    found, _ = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    contours = []
    for contour in found:
        kept = cv2.approxPolyDP(contour, MAX_DEVIATION_CELLS * SUBCELLS, closed=True)[:, 0].astype(np.float64)
        if len(kept) < 3:
            continue
        cells = (kept[:, ::-1] + 0.5) / SUBCELLS - 1.5
        contours.append(grid.geometry.centres(cells))
    return contours


def svg_text(grid: OccupancyGrid) -> str:
    """The walls as one SVG path, 1 unit a metre, y up as in the map; `data-origin` is the map's point at the lower left."""
    contours = wall_contours(grid)
    rows, cols = grid.probability.shape
    corners = grid.geometry.centres(
        np.array([(-0.5, -0.5), (rows - 0.5, cols - 0.5), (-0.5, cols - 0.5), (rows - 0.5, -0.5)])
    )
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    path = " ".join(
        "M " + " L ".join(f"{x:.4f},{y:.4f}" for x, y in part.tolist()) + " Z" for part in contours
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{x1 - x0:.4f}m" height="{y1 - y0:.4f}m" '
        f'viewBox="{x0:.4f} {-y1:.4f} {x1 - x0:.4f} {y1 - y0:.4f}" data-origin="{x0:.4f} {y0:.4f}">\n'
        f'<g transform="scale(1 -1)"><path fill="black" fill-rule="evenodd" d="{path}"/></g>\n</svg>\n'
    )


def dxf_text(grid: OccupancyGrid) -> str:
    """The walls as closed polylines of a DXF drawing (R12) in metres, on the layer WALLS."""
    lines = ["0", "SECTION", "2", "ENTITIES"]
    for contour in wall_contours(grid):
        lines += ["0", "POLYLINE", "8", "WALLS", "66", "1", "70", "1", "10", "0.0", "20", "0.0", "30", "0.0"]
        for x, y in contour.tolist():
            lines += ["0", "VERTEX", "8", "WALLS", "10", f"{x:.4f}", "20", f"{y:.4f}", "30", "0.0"]
        lines += ["0", "SEQEND", "8", "WALLS"]
    return "\n".join([*lines, "0", "ENDSEC", "0", "EOF", ""])


def geotiff_bytes(grid: OccupancyGrid, epsg: int, easting_northing: tuple[float, float]) -> bytes:
    """The cells as a GeoTIFF (0 occupied, 254 free, 205 unknown).

    `easting_northing` are the coordinates (m) of the map frame's origin in the projected system `epsg`; its x axis points east.
    Raises ConfigError: the EPSG code is none of a projected system in 16 bits.
    """
    if not 1024 <= epsg <= 32767:
        raise ConfigError(f"--epsg {epsg}: expected the code of a projected system, from 1024 to 32767")
    p = grid.probability[::-1]
    pixels = np.full(p.shape, 205, np.uint8)
    pixels[p <= FREE_UP_TO] = 254
    pixels[p >= OCCUPIED_FROM] = 0
    rows, _ = p.shape
    cell = grid.geometry.resolution_m
    top_left, right, below = grid.geometry.centres(
        np.array([(rows - 0.5, -0.5), (rows - 0.5, 0.5), (rows - 1.5, -0.5)])
    ) + np.asarray(easting_northing)
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    if grid.geometry.yaw_rad:
        dx, dy = right - top_left, below - top_left
        matrix = (dx[0], dy[0], 0, top_left[0], dx[1], dy[1], 0, top_left[1], *(0,) * 4, *(0,) * 3, 1)
        _set(tags, TRANSFORMATION, tuple(float(v) for v in matrix), DOUBLE)
    else:
        _set(tags, PIXEL_SCALE, (cell, cell, 0.0), DOUBLE)
        _set(tags, TIE_POINT, (0.0, 0.0, 0.0, float(top_left[0]), float(top_left[1]), 0.0), DOUBLE)
    keys = (
        1,
        1,
        0,
        3,
        1024,
        0,
        1,
        1,
        1025,
        0,
        1,
        1,
        3072,
        0,
        1,
        epsg,
    )  # a projected system, pixels are areas
    _set(tags, GEO_KEYS, keys, SHORT)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="TIFF", tiffinfo=tags, compression="tiff_deflate")
    return buffer.getvalue()


def _set(tags: TiffImagePlugin.ImageFileDirectory_v2, tag: int, values: tuple[float, ...], kind: int) -> None:
    tags.tagtype[tag] = kind
    tags[tag] = values
