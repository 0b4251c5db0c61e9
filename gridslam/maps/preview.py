"""Picture of a map: walls, free space, the path and marks on it, within axes in metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.picture import ink
from gridslam.maps.picture.cells import Tint, apply_tint, cell_colours
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
Footprint: TypeAlias = tuple[Floats, Colour, str]  # corners (k, 2) in the map frame, colour, name


CELLS = (
    LegendEntry("area", ink.FREE, "free"),
    LegendEntry("area", ink.WALL, "occupied"),
    LegendEntry("area", ink.UNKNOWN, "unknown"),
)
BAND_OPACITY, PARTICLE_OPACITY, FOOTPRINT_OPACITY = 0.45, 0.6, 0.5
BAND_STDS = 2.0  # half width of the band of uncertainty, in standard deviations
MAX_JUMP_M = 2.0  # untrusted poses that are farther apart than this are not joined by a line


@dataclass(frozen=True, slots=True)
class PathMarks:
    """Marks on the n poses of a path; an empty array draws nothing.

    `is_untrusted` `(n,)`: whether the method does not trust a pose. `std_m` `(n,)`: standard deviation of the position, NaN if
    unknown. `loops` `(k, 2, 2)`: pairs of positions (x, y) that loop closures join.
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
    """Settings that are the same in all pieces of a picture."""

    step_m: float  # between the ticks
    line_px: float  # width of the path
    text_px: int
    with_grid: bool


def _piece(
    grid: OccupancyGrid, window: MapWindow, layers: _Layers, tints: Sequence[Tint], style: _Style
) -> tuple[Image.Image, bool]:
    """The picture of a window, with its axes, and whether the origin of the map frame lies in it."""
    canvas = cell_colours(grid, window)
    for tint in tints:
        apply_tint(canvas, tint, grid, window)
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
        """The runs of poses to draw as one line each: (whether untrusted, first index, one past the last)."""
        if not len(self.xy):
            return []
        changes = np.flatnonzero(np.diff(self.is_untrusted)) + 1
        # A lost robot that is found elsewhere did not drive there in a straight line.
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
        """The entries of the layers that are not empty."""
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
        """Draw all layers, but for the ends of the path, on the cells of a window."""
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
    """Whether a position `(n, 2)` is farther than MAX_JUMP_M from the one before it."""
    return bool(np.hypot(*(xy[index] - xy[index - 1])) > MAX_JUMP_M)


def _finite_xy(rows: Floats | None) -> Floats:
    """The finite positions `(m, 2)` among points `(n, 2)` or poses `(n, 3)`."""
    if rows is None or not len(rows):
        return np.zeros((0, 2))
    xy = np.asarray(rows, dtype=np.float64)[:, :2]
    return np.asarray(xy[np.isfinite(xy).all(axis=1)])


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
