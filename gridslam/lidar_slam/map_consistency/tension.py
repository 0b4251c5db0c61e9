"""Differences between a finished trajectory and the motions that scan matching measured: strained paths and open loops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance
from gridslam.graph.pose_graph import Edges, chi_squared
from gridslam.lidar_slam.loop_closure.drift import DriftModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POSE_STD_M, POSE_STD_RAD = 0.03, 0.003  # standard deviations of each scan's pose, beside the drift
# Lengths of the parts of the path: a wrong loop strains a short one much, or a long one a little
LENGTHS_M = (5.0, 10.0, 20.0, 40.0)


@dataclass(frozen=True, slots=True)
class StrainedPath:
    """A part of the path, given by two scans: the distance (m) between its end in the map and its end by scan matching.

    `strain` is this distance in standard deviations of the front end's drift and of the scans' poses.
    """

    start: int
    end: int
    departure_m: float
    strain: float

    @property
    def middle(self) -> int:
        """The scan halfway."""
        return (self.start + self.end) // 2


def max_strained(track: Floats, poses: Floats, rows: Ints, drift: DriftModel) -> StrainedPath | None:
    """The most strained part of the path between two of the scans `rows`, given all poses in track and map, `(n, 3)` both."""
    travel_m = cumulative_distance(track)[rows]
    variances = drift.cumulative_variances(track)[rows]
    found = []
    for length_m in LENGTHS_M:
        ends = np.searchsorted(travel_m, travel_m + length_m)
        starts = np.flatnonzero(ends < len(travel_m))
        if not len(starts):
            break
        ends = ends[starts]
        tracked = se2.between(track[rows[starts]], track[rows[ends]])
        mapped = se2.between(poses[rows[starts]], poses[rows[ends]])
        departure = np.hypot(*(mapped - tracked)[:, :2].T)
        grown = variances[ends] - variances[starts]
        across = (grown[:, 2] / 3.0 + POSE_STD_RAD**2) * length_m**2
        strain = departure / np.sqrt(grown[:, 0] + across + 2.0 * POSE_STD_M**2)
        k = int(np.argmax(strain))
        found.append(StrainedPath(int(starts[k]), int(ends[k]), float(departure[k]), float(strain[k])))
    return max(found, key=lambda path: path.strain, default=None)


def loop_residuals(poses: Floats, loops: Edges) -> Floats:
    """Normalised length `(m,)` of every loop's error: about 1 where the loop is met as well as its covariance says."""
    return np.asarray(np.sqrt(chi_squared(poses, loops) / 3.0))
