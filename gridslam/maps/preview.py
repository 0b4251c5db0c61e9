"""Picture of a map with walls, free space, the path and marks on it, in axes of metres."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.picture import ink
from gridslam.maps.picture.ink import Canvas, Colour
from gridslam.maps.picture.sheet import (
    LegendEntry,
    draw_grid,
    draw_origin,
    framed,
    joined,
    text_size,
    tick_step_m,
    with_axes,
)
from gridslam.maps.picture.window import MapWindow, choose_windows

Floats = NDArray[np.float64]
Opacity: TypeAlias = NDArray[np.float32]
Footprint: TypeAlias = tuple[Floats, Colour, str]  # corners (k, 2) in the map frame, colour, name


@dataclass(frozen=True, slots=True)
class Tint:
    """A colour over cells of the map: opacities in [0, 1] of any rows and columns, and what the legend calls it."""

    opacity: Callable[[slice, slice], Opacity]
    colour: Colour
    name: str


CELLS = (
    LegendEntry("area", ink.FREE, "free"),
    LegendEntry("area", ink.WALL, "occupied"),
    LegendEntry("area", ink.UNKNOWN, "unknown"),
)
BAND_OPACITY, PARTICLE_OPACITY, FOOTPRINT_OPACITY = 0.45, 0.6, 0.5
BLOCKS_AT_ONCE = 16  # rows of a shrunk map that are made at once: large maps take much memory
BAND_STDS = 2.0  # half width of the band of uncertainty, in standard deviations
WALL_PROBABILITY = 0.5  # probability from which a cell has no tint
MAX_JUMP_M = 2.0  # poses farther apart than this are not joined by a line where the robot is lost


@dataclass(frozen=True, slots=True)
class PathMarks:
    """Marks on the n poses of a path: distrusted poses, uncertainty and loops.

    `is_untrusted` `(n,)`: the method does not believe these poses. `std_m` `(n,)`: standard deviation of the position, NaN where
    it is unknown. `loops` `(k, 2, 2)`: pairs of positions that loop closures join.
    """

    is_untrusted: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    std_m: Floats = field(default_factory=lambda: np.zeros(0))
    loops: Floats = field(default_factory=lambda: np.zeros((0, 2, 2)))


NO_MARKS = PathMarks()


def render_map(
    grid: OccupancyGrid,
    trajectory: Trajectory | None = None,
    points: Floats | None = None,
    particles: Floats | None = None,
    title: str | None = None,
    footprints: Sequence[Footprint] = (),
    tints: Sequence[Tint] = (),
    marks: PathMarks = NO_MARKS,
    with_grid: bool = False,
    whole: bool = False,
) -> Image.Image:
    """An RGB picture of a map, in the grid's axes (x to the right, y up).

    The longer side has about 600 to 2300 pixels. A long map is divided into pieces, from left to right or from bottom to top.
    The same input gives the same picture.

    trajectory: Drawn as a line, with its start (green) and end (red).
    points: Red dots `(n, 2)` in the map frame.
    particles: Orange dots `(n, 2)` or `(n, 3)` in the map frame.
    title: Written above the map.
    footprints: Drawn with their names below them.
    tints: Colours of cells other than walls; the last one covers the others.
    marks: Untrusted poses, standard deviations and loop closures of the trajectory.
    with_grid: Draw lines at the ticks of the axes.
    whole: Draw unknown margins as well, not only the known part.
    """
    path = _Path.of(trajectory, marks)
    windows = choose_windows(grid, path.xy, whole)
    is_upright = len(windows) > 1 and windows[0].row0 != windows[1].row0
    sizes = [window.size_px for window in windows]
    width = sum(w for w, _ in sizes) if is_upright else max(w for w, _ in sizes)
    text_px = text_size(width)
    layers = _Layers(path, _finite_xy(points), _finite_xy(particles), footprints)
    step_m = tick_step_m(windows[0].px_per_m, text_px)
    style = _Style(step_m, max(2.5, width / 450), text_px, with_grid)
    pieces = [_piece(grid, window, layers, tints, style) for window in windows]
    sheet = joined([piece for piece, _ in pieces], side_by_side=is_upright)
    origin = (LegendEntry("axes", ink.AXIS_X, "origin"),) if any(has for _, has in pieces) else ()
    cell = f"cell {grid.geometry.resolution_m * 100:.4g} cm"
    if with_grid:
        cell += f", grid {step_m:g} m"
    legend = (*CELLS, *(LegendEntry("area", t.colour, t.name) for t in tints), *layers.legend(), *origin)
    return framed(sheet, (windows[0].px_per_m, cell), legend, title, text_px)


@dataclass(frozen=True, slots=True)
class _Style:
    """Sizes that are the same in all pieces of a picture."""

    step_m: float
    line_px: float
    text_px: int
    with_grid: bool


def _piece(
    grid: OccupancyGrid, window: MapWindow, layers: _Layers, tints: Sequence[Tint], style: _Style
) -> tuple[Image.Image, bool]:
    """A window with its axes, and whether the origin of the map frame lies in it."""
    canvas = _cells(grid, window)
    for tint in tints:
        _apply_tint(canvas, tint, grid, window)
    if style.with_grid:
        draw_grid(canvas, window, style.step_m)
    layers.draw(canvas, window, style.line_px, style.text_px)
    has_origin = draw_origin(canvas, window, 2.2 * style.text_px, max(round(0.6 * style.line_px), 2))
    layers.draw_ends(canvas, window, style.line_px)
    return with_axes(canvas, window, style.step_m, style.text_px), has_origin


@dataclass(frozen=True, slots=True)
class _Path:
    """The finite positions `(n, 2)` of a trajectory, with their marks."""

    xy: Floats
    is_untrusted: NDArray[np.bool_]
    std_m: Floats
    loops: Floats

    @staticmethod
    def of(trajectory: Trajectory | None, marks: PathMarks) -> _Path:
        poses = np.zeros((0, 3)) if trajectory is None else np.asarray(trajectory.poses, np.float64)
        kept = np.isfinite(poses[:, :2]).all(axis=1)
        untrusted = marks.is_untrusted if len(marks.is_untrusted) else np.zeros(len(poses), np.bool_)
        std = marks.std_m if len(marks.std_m) else np.full(len(poses), np.nan)
        return _Path(poses[kept, :2], untrusted[kept], std[kept], marks.loops)

    def runs(self) -> list[tuple[bool, int, int]]:
        """Parts of the path that are trusted or not: whether untrusted, first index, one past the last."""
        if not len(self.xy):
            return []
        changes = np.flatnonzero(np.diff(self.is_untrusted)) + 1
        # A robot that is found elsewhere did not drive there.
        jumps = np.hypot(*np.diff(self.xy, axis=0).T) > MAX_JUMP_M
        either = self.is_untrusted[1:] | self.is_untrusted[:-1]
        cuts = np.flatnonzero(jumps & either) + 1
        ends = np.unique(np.concatenate([[0, len(self.xy)], changes, cuts]))
        return [(bool(self.is_untrusted[a]), int(a), int(b)) for a, b in pairwise(ends)]


@dataclass(frozen=True, slots=True)
class _Layers:
    """Layers of a picture above the cells: path, points, particles and footprints."""

    path: _Path
    points: Floats
    particles: Floats
    footprints: Sequence[Footprint]

    def legend(self) -> list[LegendEntry]:
        """The entries of what is there."""
        path = self.path
        trusted = len(path.xy) and not path.is_untrusted.all()
        entries = [
            (trusted, LegendEntry("line", ink.PATH, "path")),
            (path.is_untrusted.any(), LegendEntry("line", ink.UNTRUSTED, "not trusted")),
            (np.isfinite(path.std_m).any(), LegendEntry("area", ink.BAND, "2 std")),
            (len(path.loops), LegendEntry("line", ink.LOOP, "loops closed")),
            (len(path.xy), LegendEntry("dot", ink.START, "start")),
            (len(path.xy), LegendEntry("dot", ink.END, "end")),
        ]
        return [entry for is_there, entry in entries if is_there]

    def draw(self, canvas: Canvas, window: MapWindow, line_px: float, text_px: int) -> None:
        """Draw all on the cells of a window."""
        if len(self.particles):
            at = window.pixels(self.particles)
            ink.translucent(canvas, PARTICLE_OPACITY, lambda c: ink.dots(c, at, ink.PARTICLES, 0.6 * line_px))
        for corners, colour, name in self.footprints:
            _draw_footprint(canvas, window.pixels(corners), colour, name, (line_px, text_px))
        if len(self.path.xy):
            self._draw_path(canvas, window, line_px)
        if len(self.points):
            ink.dots(canvas, window.pixels(self.points), ink.POINTS, 0.6 * line_px)

    def _draw_path(self, canvas: Canvas, window: MapWindow, line_px: float) -> None:
        path, at = self.path, window.pixels(self.path.xy)
        wide = np.isfinite(path.std_m)
        if wide.any():
            radii = (BAND_STDS * path.std_m[wide] * window.px_per_m).tolist()
            ink.translucent(canvas, BAND_OPACITY, lambda c: ink.circles(c, at[wide], ink.BAND, radii))
        for is_untrusted, first, last in path.runs():
            joint = first if is_untrusted or first == 0 or _is_jump(path.xy, first) else first - 1
            ink.line(canvas, at[joint:last], ink.UNTRUSTED if is_untrusted else ink.PATH, line_px)
        for ends in path.loops:
            pixels = window.pixels(ends)
            ink.line(canvas, pixels, ink.LOOP, 0.5 * line_px)
            ink.dots(canvas, pixels, ink.LOOP, line_px)

    def draw_ends(self, canvas: Canvas, window: MapWindow, line_px: float) -> None:
        """Draw the start and the end of the path."""
        at = window.pixels(self.path.xy)
        for end, colour in ((at[:1], ink.START), (at[-1:], ink.END)):
            ink.dots(canvas, end, ink.PAPER, 3.2 * line_px)
            ink.dots(canvas, end, colour, 2.4 * line_px)


def _is_jump(xy: Floats, index: int) -> bool:
    return bool(np.hypot(*(xy[index] - xy[index - 1])) > MAX_JUMP_M)


def _finite_xy(rows: Floats | None) -> Floats:
    if rows is None or not len(rows):
        return np.zeros((0, 2))
    xy = np.asarray(rows, dtype=np.float64)[:, :2]
    return np.asarray(xy[np.isfinite(xy).all(axis=1)])


def _cells(grid: OccupancyGrid, window: MapWindow) -> Canvas:
    """The cells as colours; a shrunk map shows the most occupied cell of each block, so that walls remain visible."""
    shrink = _shrink(window)
    rows, cols = (window.row1 - window.row0) // shrink, (window.col1 - window.col0) // shrink
    colours: Canvas = np.empty((rows, cols, 3), np.uint8)
    top = rows
    for cells in _blocks(grid, window):
        colours[top - len(cells) : top] = _colours_of(cells)[::-1]
        top -= len(cells)
    return colours if colours.shape[1::-1] == window.size_px else np.array(_enlarged(colours, window))


def _colours_of(cells: NDArray[np.float32]) -> Canvas:
    """The colours of probabilities; -1: unknown."""
    steps = np.rint(np.clip(cells, 0.0, 1.0) * 255.0).astype(np.uint8)
    occupancy = np.arange(256)[:, None] / 255.0
    table = np.rint(np.asarray(ink.FREE) * (1.0 - occupancy) + np.asarray(ink.WALL) * occupancy)
    colours = table.astype(np.uint8)[steps]
    colours[cells < 0.0] = ink.UNKNOWN
    return np.asarray(colours)


def _apply_tint(canvas: Canvas, tint: Tint, grid: OccupancyGrid, window: MapWindow) -> None:
    """Blend a tint over the cells that are not walls."""
    shown = np.concatenate(list(_blocks(grid, window, tint)))[::-1]
    cells = np.clip(shown, 0.0, 1.0)
    opacity = (
        np.asarray(_enlarged(np.rint(255.0 * cells).astype(np.uint8), window), np.float64)[..., None] / 255.0
    )
    canvas[:] = np.rint((1.0 - opacity) * canvas + opacity * np.asarray(tint.colour))


def _blocks(
    grid: OccupancyGrid, window: MapWindow, tint: Tint | None = None
) -> Iterator[NDArray[np.float32]]:
    """The probabilities of a window in blocks of rows, the lowest first; of a shrunk map the highest of each block. -1: unknown.

    With a tint its opacities, which are 0 where there is a wall.
    """
    k = _shrink(window)
    at_once = k * BLOCKS_AT_ONCE
    for first in range(window.row0, window.row1, at_once):
        rows = first, min(first + at_once, window.row1)
        yield _highest_of_blocks(grid.probability, tint, rows, (window.col0, window.col1), k)


def _shrink(window: MapWindow) -> int:
    """Rows, and columns, of cells that are one pixel of a shrunk map; 1 if it is not shrunk."""
    return round(1.0 / window.zoom) if window.zoom < 1.0 else 1


def _enlarged(cells: NDArray[np.uint8], window: MapWindow) -> Image.Image:
    return Image.fromarray(np.ascontiguousarray(cells)).resize(window.size_px, Image.Resampling.NEAREST)


def _highest_of_blocks(
    probability: NDArray[np.float32],
    tint: Tint | None,
    row_limits: tuple[int, int],
    col_limits: tuple[int, int],
    k: int,
) -> NDArray[np.float32]:
    """The highest value of each block of k x k cells within the limits, which may lie outside; -1: unknown."""
    (row0, row1), (col0, col1) = row_limits, col_limits
    cells = np.full((row1 - row0, col1 - col0), -1.0, np.float32)
    rows, cols = probability.shape
    r0, r1, c0, c1 = max(row0, 0), min(row1, rows), max(col0, 0), min(col1, cols)
    if r0 < r1 and c0 < c1:
        part = np.nan_to_num(probability[r0:r1, c0:c1], nan=-1.0)
        if tint is not None:
            part = np.where(part >= WALL_PROBABILITY, 0.0, tint.opacity(slice(r0, r1), slice(c0, c1)))
        cells[r0 - row0 : r1 - row0, c0 - col0 : c1 - col0] = part
    if k == 1:
        return cells
    return np.asarray(cells.reshape(cells.shape[0] // k, k, cells.shape[1] // k, k).max(axis=(1, 3)))


def _draw_footprint(
    canvas: Canvas, pixels: Floats, colour: Colour, name: str, sizes: tuple[float, int]
) -> None:
    line_px, text_px = sizes
    ink.translucent(canvas, FOOTPRINT_OPACITY, lambda c: ink.polygon(c, pixels, colour))
    ink.line(canvas, np.concatenate([pixels, pixels[:1]]), colour, line_px)
    if name:
        _draw_name(canvas, pixels, colour, name, text_px)


def _draw_name(canvas: Canvas, pixels: Floats, colour: Colour, name: str, text_px: int) -> None:
    """The name below a footprint."""
    picture = Image.fromarray(canvas)
    middle, below = float(pixels[:, 0].mean()), float(pixels[:, 1].max()) + 0.5 * text_px
    font = ImageFont.load_default(max(round(0.8 * text_px), 12))
    ImageDraw.Draw(picture).text(
        (middle, below), name, fill=colour, font=font, anchor="mt", stroke_width=2, stroke_fill=ink.PAPER
    )
    canvas[:] = np.asarray(picture)
