"""Map and drawing compared under the warp: agreement of each room, what the drawing lacks, and what it has too much of."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.handmap_slam.warp.evidence import to_drawing
from gridslam.methods.handmap_slam.warp.warp import DrawingWarp

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEAR_M = 4.0  # the warp of a place is used up to this distance
DRAWN_WITHIN_M = 0.5  # a mapped surface this close to a drawn wall is drawn, and the reverse
STAND_OFF_M = 0.4  # free space counts as observed up to this distance before a surface
DOOR_M = 0.65  # half the width of openings between two rooms
MIN_ROOM_M2 = 1.0
MIN_OBSERVED, MIN_AGREEMENT = 0.1, 0.6  # fractions: less is not visited, or differs


@dataclass(frozen=True)
class DrawnRoom:
    """A room of the drawing: its middle (drawing units), its size (m^2), and fractions that were observed and that agree."""

    x: float
    y: float
    area_m2: float
    observed: float
    agreement: float

    @property
    def state(self) -> str:
        """State of the room in words: not visited, agrees or differs."""
        if self.observed < MIN_OBSERVED:
            return "not visited"
        return "agrees" if self.agreement >= MIN_AGREEMENT else "differs"


@dataclass(frozen=True)
class DrawingComparison:
    """Rooms `(rows, cols)` numbered from 1, and masks of the drawing.

    `lacking` are mapped surfaces that are not drawn, `extra` drawn walls through observed free space; lengths in metres.
    """

    rooms: list[DrawnRoom]
    labels: NDArray[np.int32]
    observed: Mask
    lacking: Mask
    extra: Mask
    lacking_m: float
    extra_m: float
    wall_agreement: float
    place_agreement: Floats


def compare(drawn: DrawnMap, warp: DrawingWarp) -> DrawingComparison:
    """Compare the surfaces and the free space visible from all places with the drawing."""
    cell = drawn.geometry.resolution_m
    scale = float(np.exp(np.median(warp.states[:, 3:].mean(axis=1))))
    graph, p = warp.graph, len(warp.states)
    owner = np.repeat(np.arange(p), [len(v) for v in graph.views])
    offsets = np.concatenate(graph.views)
    near = np.hypot(*offsets.T) < NEAR_M
    owner, offsets = owner[near], offsets[near]
    cells = drawn.geometry.cells(to_drawing(warp.states[owner], offsets))
    rows, cols = drawn.walls.shape
    inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
    to_wall = distances_to(drawn.walls) * cell
    clipped = np.clip(cells, 0, (rows - 1, cols - 1))
    is_drawn = inside & (to_wall[clipped[:, 0], clipped[:, 1]] < DRAWN_WITHIN_M * scale)
    counts = np.maximum(np.bincount(owner, minlength=p), 1)
    surfaces, matched = (np.zeros((rows, cols), np.bool_) for _ in range(2))
    surfaces[cells[inside, 0], cells[inside, 1]] = True
    matched[cells[is_drawn, 0], cells[is_drawn, 1]] = True
    observed = _observed(drawn, warp)
    lacking = surfaces & ~matched
    extra = drawn.walls & observed & (distances_to(surfaces) * cell > DRAWN_WITHIN_M * scale)
    labels = _rooms(drawn, DOOR_M * scale / cell)
    rooms = [
        _room(room=labels == k, observed=observed, surfaces=surfaces, matched=matched, cell=cell, scale=scale)
        for k in range(1, int(labels.max()) + 1)
    ]
    in_m = cell / scale
    return DrawingComparison(
        rooms=rooms,
        labels=labels,
        observed=observed,
        lacking=lacking,
        extra=extra,
        lacking_m=float(_length(lacking)) * in_m,
        extra_m=float(_length(extra)) * in_m,
        wall_agreement=float(is_drawn.mean()) if len(is_drawn) else 0.0,
        place_agreement=np.bincount(owner, is_drawn, p) / counts,
    )


def _observed(drawn: DrawnMap, warp: DrawingWarp) -> Mask:
    """The drawing's cells that were seen free from some place."""
    image = np.zeros(drawn.walls.shape, np.uint8)
    cell = drawn.geometry.resolution_m
    for view, state in zip(warp.graph.views, warp.states, strict=True):
        if len(view) < 3:
            continue
        ranges = np.hypot(*view.T)
        kept = np.clip(np.minimum(ranges, NEAR_M) - STAND_OFF_M, 0.0, None) / np.maximum(ranges, 1e-6)
        polygon = to_drawing(state, view * kept[:, None]) / cell
        cv2.fillPoly(image, [np.floor(polygon).astype(np.int32)], 1)
    return np.asarray(image > 0)


def _rooms(drawn: DrawnMap, door_px: float) -> NDArray[np.int32]:
    """The drawing's free space divided at its doors, numbered from 1; 0 elsewhere."""
    inside = drawn.free if drawn.reading is None else drawn.free | drawn.reading.enclosed
    cores = inside & (distances_to(~inside) > max(door_px, 1.0))
    _, labels = cv2.connectedComponents(cores.astype(np.uint8), connectivity=4)
    if not cores.any():
        return np.asarray(inside, np.int32)
    _, nearest = cv2.distanceTransformWithLabels(
        (~cores).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(nearest.max()) + 1, np.int32)
    of_label[nearest[cores]] = labels[cores]
    return np.asarray(np.where(inside, of_label[nearest], 0), np.int32)


def _room(room: Mask, observed: Mask, surfaces: Mask, matched: Mask, cell: float, scale: float) -> DrawnRoom:
    y, x = np.nonzero(room)
    around = cv2.dilate(room.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    count = int((surfaces & around).sum())
    return DrawnRoom(
        x=float(x.mean() + 0.5) * cell,
        y=float(y.mean() + 0.5) * cell,
        area_m2=len(x) * (cell / scale) ** 2,
        observed=float((room & observed).sum()) / len(x),
        agreement=float((matched & around).sum()) / count if count else 0.0,
    )


def _length(cells: Mask) -> int:
    """The number of cells of a thin mask, single ones left out."""
    count, _, stats, _ = cv2.connectedComponentsWithStats(
        cv2.dilate(cells.astype(np.uint8), np.ones((3, 3), np.uint8)), connectivity=8
    )
    sizes = stats[1:count]
    return int(np.maximum(sizes[:, cv2.CC_STAT_WIDTH], sizes[:, cv2.CC_STAT_HEIGHT])[sizes[:, 4] > 30].sum())
