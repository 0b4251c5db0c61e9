"""The result of a run in the plane, beside the odometry and the ground truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Alignment, find_alignment
from gridslam.evaluation.association import associate
from gridslam.report.figures.plots import PlanePath, plane_plot
from gridslam.runs.run import Run

RESULT_COLOUR, ODOMETRY_COLOUR, TRUTH_COLOUR = "#1e6ec8", "#d9661f", "#555555"
# The odometry is aligned with the first of this many poses of the result that lies within its time
FIRST_POSES = 5


def path_plot(run: Run) -> str | None:
    """An SVG element with the result, the odometry from the same start, and the ground truth; None without the last two."""
    path = run.result.trajectory.sorted()
    if not len(path):
        return None
    paths = [PlanePath(path.poses[:, :2], RESULT_COLOUR, "result")]
    odometry = _from_the_same_start(run.odometry.sorted(), path)
    if odometry is not None:
        paths.insert(0, PlanePath(odometry, ODOMETRY_COLOUR, "odometry"))
    truth = _truth_in_the_results_frame(run, path)
    if truth is not None:
        paths.append(PlanePath(truth, TRUTH_COLOUR, "truth", is_dashed=True))
    return plane_plot(paths) if len(paths) > 1 else None


def _from_the_same_start(odometry: Trajectory, path: Trajectory) -> NDArray[np.float64] | None:
    """Positions `(n, 2)` of the odometry, moved so that it agrees with the result at the result's first stamp."""
    at, inside = odometry.at(path.stamps_ns[:FIRST_POSES])
    if len(odometry) < 2 or not inside.any():
        return None
    first = int(np.flatnonzero(inside)[0])
    T_map_odom = se2.compose(path.poses[first], se2.inverse(at[first]))
    return np.asarray(se2.transform_points(T_map_odom, odometry.poses[:, :2]))


def _truth_in_the_results_frame(run: Run, path: Trajectory) -> NDArray[np.float64] | None:
    """Positions `(n, 2)` of the ground truth: a new map has an arbitrary frame, so the truth is aligned with the result."""
    if run.truth is None:
        return None
    truth = run.truth.sorted()
    pairs = associate(path, truth)
    align = Alignment(np.zeros(3))
    if run.command != "localize":
        found = find_alignment(pairs.truth, pairs.estimate, "se2") if len(pairs) else None
        if found is None:
            return None
        align = found
    return np.asarray(align.apply(truth.poses)[:, :2])
