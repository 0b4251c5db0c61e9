"""Picture of a map with walls, free space, the path and a scale bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

Colour: TypeAlias = tuple[int, int, int]
Footprint: TypeAlias = tuple[
    NDArray[np.float64], Colour, str
]  # corners (k, 2) in the map frame, colour, name
Shape: TypeAlias = Callable[[ImageDraw.ImageDraw, int], None]

FREE: Colour = (255, 255, 255)
WALL: Colour = (28, 32, 40)
UNKNOWN: Colour = (214, 218, 224)
PATH: Colour = (30, 110, 200)
START: Colour = (30, 150, 70)
END: Colour = (205, 45, 45)
POINTS: Colour = (205, 45, 45)
PARTICLES: Colour = (235, 130, 20)
INK: Colour = (60, 66, 76)
PAPER: Colour = (255, 255, 255)

ENLARGE_TO_PX = 1200
SHRINK_TO_PX = 2000
MAX_CELL_PX = 24
MIN_SIDE_PX = 240
MARGIN_PX = 12
LABEL_PX = 13
SMOOTHING = 3  # lines and dots are drawn at this multiple of the size and scaled down


@dataclass(frozen=True, slots=True)
class _PictureWindow:
    """The cells [row0, row1) x [col0, col1) of a picture, and its pixels a cell."""

    geometry: GridGeometry
    row0: int
    row1: int
    col0: int
    col1: int
    zoom: float
    width_px: int
    height_px: int

    def pixels(self, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixel coordinates `(n, 2)`, x to the right and y down, of points `(n, 2)` of the map frame."""
        cells = _grid_coordinates(self.geometry, points_xy)
        return np.stack(
            [(cells[:, 0] - self.col0) * self.zoom, (self.row1 - cells[:, 1]) * self.zoom], axis=1
        )


def render_map(
    grid: OccupancyGrid,
    trajectory: Trajectory | None = None,
    points: NDArray[np.float64] | None = None,
    particles: NDArray[np.float64] | None = None,
    title: str | None = None,
    footprints: Sequence[Footprint] = (),
) -> Image.Image:
    """An RGB picture of the known part of the map in the grid's axes (x to the right, y up).

    Drawn on top: the trajectory with its start (green) and end (red), `points` `(n, 2)` in the map frame
    (red dots), `particles` `(n, 2)` or `(n, 3)` (orange dots), and `footprints` with their names below them. The longer
    side has about 600 to 2000 pixels. The same input gives the same picture.
    """
    path = _finite_xy(trajectory.poses if trajectory is not None else None)
    dots, cloud = _finite_xy(points), _finite_xy(particles)
    view = _choose_view(grid, path)
    picture = _draw_cells(grid, view)
    line_px = max(2.5, min(4.0, max(picture.size) / 400))
    if len(cloud):
        _paint(picture, PARTICLES, _dots(view.pixels(cloud), 0.6 * line_px), opacity=0.6)
    for corners, colour, name in footprints:
        _draw_footprint(picture, view.pixels(corners), colour, name, line_px)
    if len(path):
        _draw_path(picture, view.pixels(path), line_px)
    if len(dots):
        _paint(picture, POINTS, _dots(view.pixels(dots), 0.6 * line_px))
    return _frame(picture, view, title)


def _finite_xy(rows: NDArray[np.float64] | None) -> NDArray[np.float64]:
    if rows is None or not len(rows):
        return np.zeros((0, 2))
    xy = np.asarray(rows, dtype=np.float64)[:, :2]
    return np.asarray(xy[np.isfinite(xy).all(axis=1)])


def _grid_coordinates(geometry: GridGeometry, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points `(n, 2)` in cells along the grid's axes: (column, row), not rounded."""
    cos, sin = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
    local = (points_xy - np.asarray(geometry.origin_xy_m)) @ np.array([[cos, -sin], [sin, cos]])
    return np.asarray(local / geometry.resolution_m)


def _choose_view(grid: OccupancyGrid, path: NDArray[np.float64]) -> _PictureWindow:
    """The window with the known cells and the path near them, and a margin; small maps are enlarged, large ones shrunk."""
    known = ~np.isnan(grid.probability)
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    box = np.array([rows[0], rows[-1] + 1, cols[0], cols[-1] + 1]) if len(rows) else np.array([0, 1, 0, 1])
    if len(path):
        cells = _grid_coordinates(grid.geometry, path)
        # Parts of the path far from the map are left out: they would shrink the map to a dot.
        max_distance = 2 * max(box[1] - box[0], box[3] - box[2], 50)
        inside = cells[(np.abs(cells - [box[2:].mean(), box[:2].mean()]) < max_distance).all(axis=1)]
        if len(inside):
            lo, hi = np.floor(inside.min(axis=0)).astype(int), np.ceil(inside.max(axis=0)).astype(int)
            box = np.array([min(box[0], lo[1]), max(box[1], hi[1]), min(box[2], lo[0]), max(box[3], hi[0])])
    side = int(max(box[1] - box[0], box[3] - box[2]))
    shrink = -(-side // SHRINK_TO_PX)
    zoom = 1.0 / shrink if shrink > 1 else float(min(max(ENLARGE_TO_PX // side, 1), MAX_CELL_PX))
    margin = int(np.ceil(MARGIN_PX / zoom))
    height, width = box[1] - box[0] + 2 * margin, box[3] - box[2] + 2 * margin
    smallest = int(np.ceil(MIN_SIDE_PX / zoom))
    extra_rows, extra_cols = max(smallest - height, 0), max(smallest - width, 0)
    row0, col0 = int(box[0] - margin - extra_rows // 2), int(box[2] - margin - extra_cols // 2)
    n_rows, n_cols = (-(-int(n) // shrink) * shrink for n in (height + extra_rows, width + extra_cols))
    return _PictureWindow(
        geometry=grid.geometry,
        row0=row0,
        row1=row0 + n_rows,
        col0=col0,
        col1=col0 + n_cols,
        zoom=zoom,
        width_px=round(n_cols * zoom),
        height_px=round(n_rows * zoom),
    )


def _draw_cells(grid: OccupancyGrid, view: _PictureWindow) -> Image.Image:
    """The cells as colours; a shrunk map shows the most occupied cell of each block, so that walls remain visible."""
    window = np.full((view.row1 - view.row0, view.col1 - view.col0), -1.0, np.float32)  # -1: unknown
    rows, cols = grid.probability.shape
    r0, r1 = max(view.row0, 0), min(view.row1, rows)
    c0, c1 = max(view.col0, 0), min(view.col1, cols)
    part = grid.probability[r0:r1, c0:c1]
    window[r0 - view.row0 : r1 - view.row0, c0 - view.col0 : c1 - view.col0] = np.where(
        np.isnan(part), -1.0, part
    )
    if view.zoom < 1.0:
        k = round(1.0 / view.zoom)
        window = window.reshape(window.shape[0] // k, k, window.shape[1] // k, k).max(axis=(1, 3))
    steps = np.rint(np.clip(window[::-1], 0.0, 1.0) * 255.0).astype(np.uint8)
    occupancy = np.arange(256)[:, None] / 255.0
    table = np.rint(np.asarray(FREE) * (1.0 - occupancy) + np.asarray(WALL) * occupancy).astype(np.uint8)
    colours = table[steps]
    colours[window[::-1] < 0.0] = UNKNOWN
    picture = Image.fromarray(colours)
    return picture.resize((view.width_px, view.height_px), Image.Resampling.NEAREST)


def _draw_path(picture: Image.Image, pixels: NDArray[np.float64], line_px: float) -> None:
    _paint(picture, PATH, _line(pixels, line_px))
    for end, colour in ((pixels[:1], START), (pixels[-1:], END)):
        _paint(picture, PAPER, _dots(end, 3.2 * line_px))
        _paint(picture, colour, _dots(end, 2.4 * line_px))


def _draw_footprint(
    picture: Image.Image, pixels: NDArray[np.float64], colour: Colour, name: str, line_px: float
) -> None:
    closed = np.concatenate([pixels, pixels[:1]])
    _paint(picture, colour, _polygon(pixels), opacity=0.5)
    _paint(picture, colour, _line(closed, line_px))
    middle = pixels.mean(axis=0)
    below = float(pixels[:, 1].max()) + 8.0
    font = ImageFont.load_default(LABEL_PX)
    ImageDraw.Draw(picture).text((float(middle[0]), below), name, fill=colour, font=font, anchor="mt")


def _polygon(pixels: NDArray[np.float64]) -> Shape:
    def draw_polygon(draw: ImageDraw.ImageDraw, scale: int) -> None:
        draw.polygon([(float(x), float(y)) for x, y in pixels * scale], fill=255)

    return draw_polygon


def _line(pixels: NDArray[np.float64], width_px: float) -> Shape:
    def draw_line(draw: ImageDraw.ImageDraw, scale: int) -> None:
        corners = [(float(x), float(y)) for x, y in pixels * scale]
        draw.line(corners, fill=255, width=round(width_px * scale), joint="curve")

    return draw_line


def _dots(pixels: NDArray[np.float64], radius_px: float) -> Shape:
    def draw_dots(draw: ImageDraw.ImageDraw, scale: int) -> None:
        r = radius_px * scale
        for x, y in pixels * scale:
            draw.ellipse((x - r, y - r, x + r, y + r), fill=255)

    return draw_dots


def _paint(picture: Image.Image, colour: Colour, shape: Shape, opacity: float = 1.0) -> None:
    """Paint a shape in one colour with smooth edges; `shape` draws it in white at SMOOTHING times the size."""
    mask = Image.new("L", (picture.width * SMOOTHING, picture.height * SMOOTHING), 0)
    shape(ImageDraw.Draw(mask), SMOOTHING)
    small = mask.reduce(SMOOTHING)
    if opacity < 1.0:
        small = small.point([round(level * opacity) for level in range(256)])
    picture.paste(colour, (0, 0), small)


def _frame(picture: Image.Image, view: _PictureWindow, title: str | None) -> Image.Image:
    """The picture with a heading above, and below it the scale bar and the cell size."""
    size = 16
    font = ImageFont.load_default(size)
    head = 2 * size if title else 0
    foot = 2 * size
    sheet = Image.new("RGB", (picture.width, picture.height + head + foot), PAPER)
    sheet.paste(picture, (0, head))
    draw = ImageDraw.Draw(sheet)
    if title:
        draw.text((MARGIN_PX, head // 2), title, fill=INK, font=font, anchor="lm")
    px_per_m = view.zoom / view.geometry.resolution_m
    length_m = _round_length(0.25 * picture.width / px_per_m)
    middle, right = head + picture.height + foot // 2, MARGIN_PX + length_m * px_per_m
    draw.rectangle((MARGIN_PX, middle - 2, right, middle + 2), fill=INK)
    draw.text((right + 8, middle), f"{length_m:g} m", fill=INK, font=font, anchor="lm")
    cell = f"cell {view.geometry.resolution_m * 100:.4g} cm"
    draw.text((picture.width - MARGIN_PX, middle), cell, fill=INK, font=font, anchor="rm")
    return sheet


def _round_length(length_m: float) -> float:
    """The largest length of 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length_m))
    return float(power * max(step for step in (1, 2, 5) if step * power <= length_m * (1 + 1e-9)))
