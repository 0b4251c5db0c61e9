"""The ranges that a lidar would measure from a pose in a map, by exact ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.grids.raycast import cast_rays, free_boxes, free_squares
from gridslam.maps.occupancy import GridGeometry
from gridslam.sensors.grid_frame import poses_in_cells

Floats = NDArray[np.float64]

LARGE_CELLS = 10_000_000  # number of cells of which all boxes would take 120 MB


@dataclass(frozen=True, slots=True)
class RangeCaster:
    """A map prepared for ray casting: `boxes` uint8 `(4 or 12, rows, cols)` are the free squares or boxes of the kernel."""

    boxes: NDArray[np.uint8]
    geometry: GridGeometry

    def ranges(
        self, poses: Floats, bearings: Floats, extrinsics: Floats, max_range_m: float
    ) -> NDArray[np.float32]:
        """Ranges (m) `(n, b)` along bearings `(b,)` of a sensor with T_base_sensor `(3,)` on robots at map poses `(n, 3)`.

        A ray that hits nothing within the maximum range has the maximum range.
        """
        sensors = poses_in_cells(self.geometry, se2.compose(poses, extrinsics))
        cell_m = self.geometry.resolution_m
        return np.asarray(cast_rays(self.boxes, sensors, bearings, max_range_m / cell_m)) * np.float32(cell_m)


def range_caster(occupied: NDArray[np.bool_], geometry: GridGeometry) -> RangeCaster:
    """The caster of a grid of occupied cells `(rows, cols)`; on a large one it is slower and takes a third of the memory."""
    prepare = free_boxes if occupied.size <= LARGE_CELLS else free_squares
    return RangeCaster(np.asarray(prepare(np.ascontiguousarray(occupied))), geometry)
