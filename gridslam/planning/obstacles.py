"""Obstacles of a map, with passages closed that are too narrow for the robot (stereo-bayes, paper section 2.5)."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

OCCUPIED_FROM = 0.9  # the paper's threshold
ROBOT_RADIUS_M = 0.2  # default robot: passages narrower than twice this are closed

Cells = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ObstacleRegion:
    """One connected obstacle, in the map frame.

    `cells` and `area_m2` include the `closed_cells` of passages too narrow for the robot; (`x`, `y`) is the centroid, `min_x` ..
    `max_y` the bounding box, `gap_m` the free width to the nearest other region (infinite if there is none) and `nearest_id`
    that region (0: none).
    """

    id: int
    cells: int
    closed_cells: int
    area_m2: float
    x: float
    y: float
    min_x: float
    min_y: float
    max_x: float
    max_y: float
    gap_m: float
    nearest_id: int

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """The names of the values of a row."""
        return tuple(field.name for field in fields(cls))

    def row(self) -> tuple[object, ...]:
        """The values as a row of a table."""
        return astuple(self)


def obstacle_cells(
    occupancy: OccupancyGrid, occupied_from: float = OCCUPIED_FROM, unknown_blocks: bool = False
) -> Cells:
    """Cells `(rows, cols)` with P > `occupied_from` (paper section 2.5), and unknown ones if `unknown_blocks`."""
    obstacles: Cells = occupancy.probability > occupied_from
    return obstacles | np.isnan(occupancy.probability) if unknown_blocks else obstacles


def close_passages(obstacles: Cells, resolution_m: float, robot_radius_m: float = ROBOT_RADIUS_M) -> Cells:
    """The obstacles, and every cell that the robot's disc cannot cover without touching one (paper section 2.5).

    This is the morphological closing of the obstacles with the robot's disc, by exact distances between cell centres. Space
    beyond the grid's edge is free.
    """
    radius = robot_radius_m / resolution_m
    if not obstacles.any() or radius <= 0.0:
        return obstacles.copy()
    margin = int(np.ceil(radius)) + 1
    padded = np.pad(obstacles, margin)
    # 0.5 cell: from the centre of an obstacle cell to its edge
    free_centres = distances_to(padded) > radius + 0.5
    covered = distances_to(free_centres) <= radius if free_centres.any() else np.zeros_like(padded)
    return np.asarray((padded | ~covered)[margin:-margin, margin:-margin] | obstacles)


def label_obstacles(obstacles: Cells) -> tuple[NDArray[np.int32], int]:
    """Labels `(rows, cols)` of the 8-connected regions, 1 to n from the lower left, 0 where free; and n."""
    labels, count = ndimage.label(obstacles, structure=np.ones((3, 3), np.int8))
    return np.asarray(labels, dtype=np.int32), int(count)


def obstacle_regions(
    occupancy: OccupancyGrid,
    robot_radius_m: float = ROBOT_RADIUS_M,
    occupied_from: float = OCCUPIED_FROM,
    unknown_blocks: bool = False,
    min_cells: int = 1,
) -> list[ObstacleRegion]:
    """The obstacles of a map with narrow passages closed (paper section 2.5), largest first, ids from 1 in that order.

    Regions with fewer than `min_cells` cells of P > `occupied_from` are dropped.
    """
    occupied = obstacle_cells(occupancy, occupied_from, unknown_blocks)
    geometry = occupancy.geometry
    labels, count = label_obstacles(close_passages(occupied, geometry.resolution_m, robot_radius_m))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    occupied_sizes = np.bincount(labels[occupied], minlength=count + 1)
    order = np.argsort(-sizes[1:], kind="stable") + 1
    kept = order[occupied_sizes[order] >= max(min_cells, 1)]
    renumbered = np.zeros(count + 1, np.int32)
    renumbered[kept] = np.arange(1, len(kept) + 1)
    labels = renumbered[labels]
    gaps_m, nearest = _gaps(labels, len(kept), geometry.resolution_m)
    return [
        _describe(
            labels,
            box,
            i,
            closed=int(sizes[old] - occupied_sizes[old]),
            geometry=geometry,
            gap_m=gaps_m[i],
            nearest=int(nearest[i]),
        )
        for i, (old, box) in enumerate(zip(kept, ndimage.find_objects(labels), strict=True), start=1)
    ]


def _describe(
    labels: NDArray[np.int32],
    box: tuple[slice, slice],
    label: int,
    closed: int,
    geometry: GridGeometry,
    gap_m: float,
    nearest: int,
) -> ObstacleRegion:
    """The region with a given label, whose bounding box in cells is `box`."""
    cells = np.argwhere(labels[box] == label) + np.array([box[0].start, box[1].start])
    centres = geometry.centres(cells)
    # half the extent of a rotated square cell along the map's axes
    half = 0.5 * geometry.resolution_m * (abs(np.cos(geometry.yaw_rad)) + abs(np.sin(geometry.yaw_rad)))
    low, high, middle = centres.min(axis=0) - half, centres.max(axis=0) + half, centres.mean(axis=0)
    return ObstacleRegion(
        id=label,
        cells=len(cells),
        closed_cells=closed,
        area_m2=len(cells) * geometry.resolution_m**2,
        x=float(middle[0]),
        y=float(middle[1]),
        min_x=float(low[0]),
        min_y=float(low[1]),
        max_x=float(high[0]),
        max_y=float(high[1]),
        gap_m=float(gap_m),
        nearest_id=nearest,
    )


def _gaps(
    labels: NDArray[np.int32], count: int, resolution_m: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Free width (m) to the nearest other region and that region's label, both indexed by label.

    Where a cell nearest to one region borders on a cell nearest to another, the two obstacle cells nearest to them are a
    candidate for the closest pair; the width is the distance between their squares.
    """
    gaps = np.full(count + 1, np.inf)
    nearest = np.zeros(count + 1, np.int64)
    if count < 2:
        return gaps, nearest
    sites = np.asarray(
        ndimage.distance_transform_edt(labels == 0, return_distances=False, return_indices=True)
    )
    owner = labels[sites[0], sites[1]]
    pairs, widths = [], []
    for axis in (0, 1):
        one, other = _neighbours(owner, axis)
        border = one != other
        site, neighbour = _neighbours(np.moveaxis(sites, 0, -1), axis)
        offset = np.abs(site[border] - neighbour[border])
        pairs.append(np.stack([one[border], other[border]]))
        widths.append(np.hypot(*np.maximum(offset - 1, 0).T) * resolution_m)
    one, other = np.concatenate([*pairs, *(pair[::-1] for pair in pairs)], axis=1)
    width = np.concatenate([*widths, *widths])
    order = np.lexsort((other, width, one))
    labels_found, first = np.unique(one[order], return_index=True)
    gaps[labels_found] = width[order][first]
    nearest[labels_found] = other[order][first]
    return gaps, nearest


def _neighbours(grid: NDArray[Any], axis: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Every cell but the last along an axis, and the one after it."""
    return np.delete(grid, -1, axis), np.delete(grid, 0, axis)
