"""One recorded scan to everything that matching and maps take of it, in one call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.scan_matching.scan_points import (
    RangeLimits,
    Sweep,
    fill_chords,
    scan_to_points,
    surface_chords,
    surface_normals,
    thin_out,
)


class PointDensity(NamedTuple):
    """Spacing and number of the points for matching; the longest chord that is filled, and the spacing of points along it."""

    spacing_m: float
    max_points: int
    max_chord_m: float
    chord_spacing_m: float


class PreparedPoints(NamedTuple):
    """All endpoints `(r, 2)`, a thinned subset `(m, 2)` with normals, and that with filled chords `(s, 2)` with normals."""

    returns: NDArray[np.float64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    surface: NDArray[np.float64]
    surface_normals: NDArray[np.float64]


@compiled
def prepare_points(
    ranges_m: NDArray[np.float32],
    sweep: Sweep,
    limits: RangeLimits,
    extrinsics: NDArray[np.float64],
    twist: NDArray[np.float64],
    density: PointDensity,
) -> PreparedPoints:
    """The points of one scan in the robot's frame, given T_base_laser (3,) and the robot's velocity (vx, vy, wz) (3,).

    `ranges_m` `(beams,)` are its readings, `sweep` the directions and times of the beams, `limits` the usable ranges; `density`
    sets which of the points are kept for matching.
    """
    returns, beams = scan_to_points(ranges_m, sweep, limits, extrinsics, twist)
    all_normals = surface_normals(returns, beams, extrinsics[:2])
    kept = thin_out(returns, density.spacing_m, density.max_points)
    points = np.empty((kept.shape[0], 2))
    normals = np.empty((kept.shape[0], 2))
    for i in range(kept.shape[0]):
        copy_row(points, i, returns[kept[i]])
        copy_row(normals, i, all_normals[kept[i]])
    chords = surface_chords(points, normals, density.max_chord_m)
    surface, filled_normals = fill_chords(points, normals, chords, density.chord_spacing_m)
    return PreparedPoints(returns, points, normals, surface, filled_normals)
