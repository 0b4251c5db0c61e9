"""Reference implementations of the copy-on-write tiles: independent maps without sharing, and tiles found by geometry."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.grids.tiles import TILE_CELLS

Floats = NDArray[np.float64]
Tile = tuple[int, int]


class IndependentMaps:
    """Maps as dictionaries from tile (row, col) to its values; every map has tiles of its own."""

    def __init__(self, count: int) -> None:
        self.maps: list[dict[Tile, NDArray[np.float32]]] = [{} for _ in range(count)]

    def own(self, index: int, tiles: list[Tile], shape: tuple[int, ...]) -> None:
        """Create the tiles that the map lacks, filled with zeros."""
        for tile in tiles:
            self.maps[index].setdefault(tile, np.zeros(shape, np.float32))

    def redistribute(self, ancestors: list[int]) -> None:
        """Replace map i by a copy of map ancestors[i]."""
        self.maps = [{tile: v.copy() for tile, v in self.maps[a].items()} for a in ancestors]


def endpoint_tiles(pose: Floats, points: Floats, resolution_m: float) -> set[Tile]:
    """The tiles that contain the points `(m, 2)`, seen from a pose."""
    cells = np.floor(se2.transform_points(pose, points)[:, ::-1] / resolution_m)
    return {(math.floor(row / TILE_CELLS), math.floor(col / TILE_CELLS)) for row, col in cells.tolist()}


def crosses(start: Floats, end: Floats, tile: Tile, tile_m: float, slack_m: float) -> bool:
    """Whether a line comes within `slack_m` of a tile's square; negative slack shrinks the square."""
    low, high = 0.0, 1.0
    for axis, index in ((0, tile[1]), (1, tile[0])):
        near, far = index * tile_m - slack_m, (index + 1) * tile_m + slack_m
        step = float(end[axis] - start[axis])
        if abs(step) < 1e-12:
            if not near <= start[axis] <= far:
                return False
            continue
        enter, leave = sorted(((near - start[axis]) / step, (far - start[axis]) / step))
        low, high = max(low, enter), min(high, leave)
    return low <= high
