"""Where a finished trajectory departs from what scan matching measured: stretched or bent paths, and loops that are not met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, chi_squared

Floats = NDArray[np.float64]

STRETCH_M = 5.0  # of path over which scan matching is accurate


@dataclass(frozen=True, slots=True)
class StretchedPath:
    """A part of the path around a scan, and by how much (m) the map changes its length."""

    x_m: float
    y_m: float
    stretch_m: float
    scan: int


def max_stretched(track: Floats, poses: Floats, travel_m: Floats) -> StretchedPath | None:
    """The part of the path of `STRETCH_M` whose chord in the map `(n, 3)` differs most from that in the track `(n, 3)`."""
    ends = np.searchsorted(travel_m, travel_m + STRETCH_M)
    starts = np.flatnonzero(ends < len(travel_m))
    if not len(starts):
        return None
    ends = ends[starts]
    tracked, mapped = se2.between(track[starts], track[ends]), se2.between(poses[starts], poses[ends])
    difference = np.abs(np.hypot(*mapped[:, :2].T) - np.hypot(*tracked[:, :2].T))
    worst = int(np.argmax(difference))
    middle = int((starts[worst] + ends[worst]) // 2)
    x, y = poses[middle, :2].tolist()
    return StretchedPath(x, y, float(difference[worst]), middle)


def loop_residuals(poses: Floats, loops: Edges) -> Floats:
    """Normalised length `(m,)` of every loop's error: about 1 where the loop is met as well as its covariance says."""
    return np.asarray(np.sqrt(chi_squared(poses, loops) / 3.0))
