"""What a lidar should measure from a pose in a map, by exact ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.raycast import cast_rays
from gridslam.maps.occupancy import GridGeometry
from gridslam.sensors.grid_frame import poses_in_cells

Floats = NDArray[np.float64]

_MOST_CLEARANCE = 255


@dataclass(frozen=True, slots=True)
class RangeCaster:
    """Occupied cells ready for ray casting: `clearance` uint8 `(rows, cols)` is the chessboard distance to the nearest one."""

    clearance: NDArray[np.uint8]
    geometry: GridGeometry

    def ranges(
        self, poses: Floats, bearings: Floats, mounting: Floats, reach_m: float
    ) -> NDArray[np.float32]:
        """Ranges (m) `(n, b)` along bearings `(b,)` of a sensor mounted at T_base_sensor `(3,)` on robots at poses `(n, 3)`.

        Where nothing is hit within the reach, the reach.
        """
        sensors = poses_in_cells(self.geometry, se2.compose(poses, mounting))
        step = self.geometry.resolution_m
        return np.asarray(cast_rays(self.clearance, sensors, bearings, reach_m / step)) * np.float32(step)


def range_caster(occupied: NDArray[np.bool_], geometry: GridGeometry) -> RangeCaster:
    """A caster for occupied cells `(rows, cols)`."""
    from scipy.ndimage import distance_transform_cdt

    if not occupied.any():
        return RangeCaster(np.full(occupied.shape, _MOST_CLEARANCE, np.uint8), geometry)
    clearance = distance_transform_cdt(~occupied, metric="chessboard")
    return RangeCaster(np.minimum(clearance, _MOST_CLEARANCE).astype(np.uint8), geometry)
