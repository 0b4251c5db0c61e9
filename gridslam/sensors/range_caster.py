"""What a lidar should measure from a pose in a map, by exact ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.raycast import cast_rays, free_squares
from gridslam.maps.occupancy import GridGeometry
from gridslam.sensors.grid_frame import poses_in_cells

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RangeCaster:
    """Occupied cells ready for ray casting: the free `squares` uint8 `(4, rows, cols)` of the kernel."""

    squares: NDArray[np.uint8]
    geometry: GridGeometry

    def ranges(
        self, poses: Floats, bearings: Floats, extrinsics: Floats, reach_m: float
    ) -> NDArray[np.float32]:
        """Ranges (m) `(n, b)` along bearings `(b,)` of a sensor mounted at T_base_sensor `(3,)` on robots at poses `(n, 3)`.

        Where nothing is hit within the reach, the reach.
        """
        sensors = poses_in_cells(self.geometry, se2.compose(poses, extrinsics))
        step = self.geometry.resolution_m
        return np.asarray(cast_rays(self.squares, sensors, bearings, reach_m / step)) * np.float32(step)


def range_caster(occupied: NDArray[np.bool_], geometry: GridGeometry) -> RangeCaster:
    """A caster for occupied cells `(rows, cols)`."""
    return RangeCaster(np.asarray(free_squares(np.ascontiguousarray(occupied))), geometry)
