"""Changes between drives: coherent places whose cells one drive saw occupied and the next one free, or the reverse.

A cell counts as changed where the two drives contradict each other beyond an error of the poses. Glass and people do not:
they are seen free and occupied within one drive. A surface that is looked through only along directions in which it was never
met may be glass as well, and is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.sessions.evidence import MAX_RANGE_M, CellFrame, Evidence, PlacedScans

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Kind = Literal["appeared", "vanished"]

SURFACE_RATIO = 0.4  # ratio of hits to hits and misses in a cell, from which it stands on a surface
SOMETIMES_RATIO = 0.08  # the same in a cell that was not always free: glass, people, poses that are not exact
# Scans that met a surface, and that looked through it, in one cell of a place
SURE_HITS, SURE_MISSES = 2, 3
MIN_HITS, MIN_MISSES = 1, 2  # the same in all other cells of a place
MAX_POSE_ERROR_M = 0.1
# A changed place reaches this far beyond the cells that contradict each other by more than an error of the poses, as far as cells
# hang together with it: the side of a box that meets a wall, and what few beams met.
GROWN_M = 0.3
# At least met, at most met by the other drive, in the cell itself
GROWN_SURFACE_RATIO, GROWN_FREE_RATIO = 0.25, 0.2
# Poses may be wrong by more where two drives overlap little. Around a place the surfaces of both are compared at offsets up to
# this one; if another offset than none explains many more of them, the drives are displaced here by it.
MAX_DISPLACED_M, AROUND_M = 0.3, 3.0
# Of the surfaces that the offset explains, and more than without it
DISPLACED_RATIO, DISPLACED_GAIN = 0.6, 0.15
JOINED_M = 0.2  # changed cells this near to each other are one place
MIN_CELLS = 4
MIN_LENGTH_M = 0.15
BEHIND_M = 0.25  # a beam that passes a cell ends this far behind it, or farther
MAX_ANGLE_RAD = np.radians(30.0)  # largest angle between a beam that met a surface and one that passes it
SAME_VIEW_RATIO = 0.3  # smallest fraction of the cells that both drives looked at from the same side
MAX_CELLS_LOOKED_AT = 400  # largest number of cells of one place that are examined


@dataclass(frozen=True, slots=True)
class Change:
    """A place that changed: its cells (row, col) `(n, 2)`, footprint, and when it was last and first seen so.

    The footprint is a rectangle about (x, y) (m) with its longer side along `yaw_rad`. `before_ns` is the last stamp at which
    the earlier drives saw the earlier state, `after_ns` the first at which drive number `drive` saw the later one.
    """

    kind: Kind
    drive: int
    cells: Ints
    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    before_ns: int
    after_ns: int

    @property
    def corners(self) -> Floats:
        """Corners `(4, 2)` of the footprint."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [self.length_m, self.width_m]
        return np.asarray(half @ np.array([[c, s], [-s, c]]) + [self.x_m, self.y_m])


def find_changes(
    before: Evidence, after: Evidence, earlier: PlacedScans, later: PlacedScans, frame: CellFrame, drive: int
) -> list[Change]:
    """Changes from the earlier state of a place to that of drive number `drive`, ordered by place.

    `before` and `after` are the evidence of the `earlier` and the `later` scans on the cells of `frame`.
    """
    found = []
    comparisons: tuple[tuple[Kind, Evidence, Evidence, PlacedScans, PlacedScans], ...] = (
        ("vanished", before, after, earlier, later),
        ("appeared", after, before, later, earlier),
    )
    for kind, surface, free, met_by, passed_by in comparisons:
        weak, sure = _weakly_contradicted(surface, free), _is_sure(surface, free)
        for cells in _places(_contradicted(surface, free, frame), sure, frame):
            if not _is_large(_grown(cells, weak, frame), frame):
                continue
            cells = _without_displaced(cells, surface, free, frame)
            if not sure[tuple(cells.T)].any() or not _is_large(place := _grown(cells, weak, frame), frame):
                continue
            seen = _observations(cells, met_by, passed_by, frame)
            if seen is not None:
                times = (seen[0], seen[1]) if kind == "vanished" else (seen[3], seen[2])
                found.append(change_of(kind, drive, place, times, frame))
    return sorted(found, key=lambda change: (change.x_m, change.y_m, change.kind))


def _contradicted(surface: Evidence, free: Evidence, frame: CellFrame) -> Bools:
    """Cells that stand on a surface by one drive, and that another one looks through without any surface near them."""
    stands = at_ratio(surface, SURFACE_RATIO, MIN_HITS)
    radius = round(MAX_POSE_ERROR_M / frame.resolution_m)
    was_met = dilated(at_ratio(free, SOMETIMES_RATIO, 1), radius)
    return stands & ~was_met & (free.misses >= MIN_MISSES)


def _weakly_contradicted(surface: Evidence, free: Evidence) -> Bools:
    """Cells that one drive met and another one looked through, where an error of the poses might explain it."""
    was_met = at_ratio(free, GROWN_FREE_RATIO, 1)
    return at_ratio(surface, GROWN_SURFACE_RATIO, 1) & ~was_met & (free.misses >= 1)


def _grown(cells: Ints, weak: Bools, frame: CellFrame) -> Ints:
    """The cells `(n, 2)` of a place with the weakly contradicted ones that hang together with it."""
    radius = round(GROWN_M / frame.resolution_m)
    low = np.maximum(cells.min(axis=0) - radius, 0)
    window = weak[tuple(slice(a, b) for a, b in zip(low, cells.max(axis=0) + radius + 1, strict=True))]
    own = np.zeros(window.shape, np.bool_)
    own[tuple((cells - low).T)] = True
    _, labels = cv2.connectedComponents((own | (window & dilated(own, radius))).astype(np.uint8))
    return np.asarray(np.argwhere(np.isin(labels, np.unique(labels[own]))) + low)


def _without_displaced(cells: Ints, surface: Evidence, free: Evidence, frame: CellFrame) -> Ints:
    """The cells `(n, 2)` of a place that contradict the other drive also if that is displaced as all around them shows."""
    around, limit = round(AROUND_M / frame.resolution_m), round(MAX_DISPLACED_M / frame.resolution_m)
    low = np.maximum(cells.min(axis=0) - around, 0)
    window = tuple(slice(a, b) for a, b in zip(low, cells.max(axis=0) + around + 1, strict=True))
    one, other = (Evidence(e.hits[window], e.misses[window]) for e in (surface, free))
    stands = at_ratio(one, SURFACE_RATIO, MIN_HITS) & (other.hits + other.misses > 0)
    met = at_ratio(other, SURFACE_RATIO, MIN_HITS)
    image = np.pad(dilated(met, 1), limit).astype(np.float32)
    explained = cv2.matchTemplate(image, stands.astype(np.float32), cv2.TM_CCORR) / max(stands.sum(), 1)
    best = np.array(np.unravel_index(int(explained.argmax()), explained.shape))
    if explained.max() < max(DISPLACED_RATIO, explained[limit, limit] + DISPLACED_GAIN):
        return cells
    moved = np.clip(cells - low + best - limit, 0, np.array(met.shape) - 1)
    was_met = dilated(met, round(MAX_POSE_ERROR_M / frame.resolution_m))
    return np.asarray(cells[~was_met[tuple(moved.T)]])


def _is_sure(surface: Evidence, free: Evidence) -> Bools:
    """Cells that one drive met, and another one looked through, often enough to stand for the cells around them."""
    return (surface.hits >= SURE_HITS) & (free.misses >= SURE_MISSES)


def at_ratio(evidence: Evidence, ratio: float, hits: int) -> Bools:
    """Cells with at least `hits` hits, in which hits make up at least the fraction `ratio` of hits and misses."""
    return (evidence.hits >= hits) & (evidence.hits >= ratio * (evidence.hits + evidence.misses))


def dilated(mask: Bools, radius: int) -> Bools:
    """Mask `(rows, cols)` of the cells within a radius (cells) of those of a mask."""
    size = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return cv2.dilate(mask.astype(np.uint8), disc).astype(np.bool_)


def _places(mask: Bools, sure: Bools, frame: CellFrame) -> list[Ints]:
    """Cells `(n, 2)` of every coherent place that has a sure cell."""
    joined = dilated(mask, max(round(0.5 * JOINED_M / frame.resolution_m), 1))
    _, labels = cv2.connectedComponents(joined.astype(np.uint8), connectivity=8)
    cells = np.argwhere(mask)
    label = labels[cells[:, 0], cells[:, 1]]
    order = np.argsort(label, kind="stable")
    groups = np.split(cells[order], np.flatnonzero(np.diff(label[order])) + 1) if len(cells) else []
    return [group for group in groups if sure[tuple(group.T)].any()]


def _is_large(cells: Ints, frame: CellFrame) -> bool:
    """Whether the cells `(n, 2)` of a place are more than what errors of the poses leave at the ends of walls."""
    length_m = float(np.ptp(cells, axis=0).max() + 1) * frame.resolution_m
    return len(cells) >= MIN_CELLS and length_m >= MIN_LENGTH_M


def _observations(
    cells: Ints, met_by: PlacedScans, passed_by: PlacedScans, frame: CellFrame
) -> tuple[int, int, int, int] | None:
    """Last stamp of a beam that met the cells and first of one that passes them; first met, and last passed.

    None if hardly any cell was passed in a direction in which it was met.
    """
    step = -(-len(cells) // MAX_CELLS_LOOKED_AT)
    centres = frame.geometry.centres(cells[::step])
    met = _looked_at(centres, met_by, frame, is_met=True)
    passed = _looked_at(centres, passed_by, frame, is_met=False)
    if not (len(met.cell) and len(passed.cell)):
        return None
    from_same_side = 0
    for cell in range(len(centres)):
        one, other = met.angle[met.cell == cell], passed.angle[passed.cell == cell]
        if len(one) and len(other):
            difference = np.abs(np.angle(np.exp(2j * (one[:, None] - other[None])))) / 2.0
            from_same_side += bool(difference.min() <= MAX_ANGLE_RAD)
    if from_same_side < SAME_VIEW_RATIO * len(centres):
        return None
    return (
        int(met.stamp_ns.max()),
        int(passed.stamp_ns.min()),
        int(met.stamp_ns.min()),
        int(passed.stamp_ns.max()),
    )


@dataclass(frozen=True, slots=True)
class _Looks:
    """Looks at cells: the cell, the direction of the beam, and its stamp, `(n,)` each."""

    cell: Ints
    angle: Floats
    stamp_ns: Ints


def _looked_at(centres: Floats, scans: PlacedScans, frame: CellFrame, *, is_met: bool) -> _Looks:
    """The looks of scans at cells, either those that end there or those that pass."""
    cells, angles, stamps = [], [], []
    middle = centres.mean(axis=0)
    radius = float(np.hypot(*(centres - middle).T).max())
    away = np.hypot(*(scans.viewpoints - middle).T)
    for k in np.flatnonzero(away <= MAX_RANGE_M + radius).tolist():
        origin, beams = scans.viewpoints[k], scans.endpoints[k] - scans.viewpoints[k]
        if not len(beams):
            continue
        beam_angle, beam_range = np.arctan2(beams[:, 1], beams[:, 0]), np.hypot(beams[:, 0], beams[:, 1])
        order = np.argsort(beam_angle)
        offset = centres - origin
        angle, distance = np.arctan2(offset[:, 1], offset[:, 0]), np.hypot(offset[:, 0], offset[:, 1])
        nearest = _nearest_angle(beam_angle[order], angle)
        missed_by = np.abs(np.angle(np.exp(1j * (beam_angle[order][nearest] - angle)))) * distance
        behind = beam_range[order][nearest] - distance
        is_behind = np.abs(behind) <= 1.5 * frame.resolution_m if is_met else behind >= BEHIND_M
        rows = np.flatnonzero(is_behind & (missed_by <= frame.resolution_m) & (distance <= MAX_RANGE_M))
        cells.append(rows)
        angles.append(angle[rows])
        stamps.append(np.full(len(rows), scans.stamps_ns[k]))
    if not cells:
        return _Looks(np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64))
    return _Looks(np.concatenate(cells), np.concatenate(angles), np.concatenate(stamps))


def _nearest_angle(ordered: Floats, angles: Floats) -> Ints:
    """Rows of the nearest of ordered angles, which wrap around."""
    after = np.searchsorted(ordered, angles) % len(ordered)
    before = (after - 1) % len(ordered)
    apart = [np.abs(np.angle(np.exp(1j * (ordered[k] - angles)))) for k in (before, after)]
    return np.where(apart[0] <= apart[1], before, after)


def change_of(kind: Kind, drive: int, cells: Ints, times: tuple[int, int], frame: CellFrame) -> Change:
    """A change by its cells `(n, 2)` and the last stamp before and the first one after it."""
    centres = frame.geometry.centres(cells)
    origin = centres[0]
    (x, y), (length, width), angle = cv2.minAreaRect((centres - origin).astype(np.float32))
    yaw = float(np.radians(angle))
    if width > length:
        length, width, yaw = width, length, yaw + 0.5 * np.pi
    yaw = float((yaw + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
    cell = frame.resolution_m
    return Change(
        kind,
        drive,
        cells,
        x_m=float(x + origin[0]),
        y_m=float(y + origin[1]),
        yaw_rad=yaw,
        length_m=float(length + cell),
        width_m=float(width + cell),
        before_ns=times[0],
        after_ns=times[1],
    )
