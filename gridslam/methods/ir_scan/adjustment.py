"""Adjustment of all stops at once: poses at which the readings of all stops lie on common walls.

Odometry links each stop to the one before, absolute poses link stops to the map.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, normal_equations
from gridslam.methods.ir_scan.stacked_readings import StackedReadings
from gridslam.methods.ir_scan.stops import Stop
from gridslam.methods.ir_scan.wall_equations import block_diagonal, wall_terms
from gridslam.sensors.infrared import RangeNoise

Floats = NDArray[np.float64]

MAX_STEPS = 15  # largest number of Gauss-Newton steps
CONVERGED = 8e-4  # largest change of any coordinate (m, rad)
FIXED_VARIANCE = 1e-10  # of the first pose (m^2, rad^2) if it has no absolute pose
MIN_ODOMETRY_COVARIANCE = np.diag([1e-7, 1e-7, 1e-7])


def adjust(stops: Sequence[Stop], cell_m: float, noise: RangeNoise) -> Floats:
    """Adjusted poses `(s, 3)` of the stops; walls are divided into segments in cells of `cell_m` (m).

    The first stop keeps its pose unless it has absolute poses.
    """
    poses = np.array([stop.pose for stop in stops])
    readings, edges = StackedReadings.of(stops), odometry_edges(stops)
    if not len(readings.stop):
        return poses
    for _ in range(MAX_STEPS):
        hessian, gradient = normal_equations(poses, edges)
        for term in (_absolute_pose_terms(poses, stops), *wall_terms(poses, readings, cell_m, noise)):
            hessian, gradient = hessian + term[0], gradient + term[1]
        step = spsolve(hessian.tocsc(), -gradient).reshape(-1, 3)
        poses = poses + step
        poses[:, 2] = se2.wrap_angle(poses[:, 2])
        if np.abs(step).max() < CONVERGED:
            break
    return poses


def odometry_edges(stops: Sequence[Stop]) -> Edges:
    """An edge from each stop to the next, where the log has odometry between them."""
    linked = [k for k in range(1, len(stops)) if stops[k].has_odometry]
    motions = [motion for k in linked if (motion := stops[k].motion) is not None]
    information = [np.linalg.inv(motion.covariance + MIN_ODOMETRY_COVARIANCE) for motion in motions]
    target = np.array(linked, np.int64)
    return Edges(
        source=target - 1,
        target=target,
        T_source_target=np.array([motion.T_stop_now for motion in motions]).reshape(-1, 3),
        information=np.array(information).reshape(-1, 3, 3),
        is_loop=np.zeros(len(target), bool),
    )


def _absolute_pose_terms(poses: Floats, stops: Sequence[Stop]) -> tuple[sparse.csr_matrix, Floats]:
    """Hessian `(3s, 3s)` and gradient `(3s,)` of the absolute poses; the first stop is fixed if it has none."""
    blocks = [np.zeros((3, 3)) for _ in stops]
    gradient = np.zeros((len(poses), 3))
    for k, stop in enumerate(stops):
        for measured in stop.absolute_poses:
            information = np.linalg.inv(measured.covariance)
            error = poses[k] - measured.pose
            error[2] = float(se2.wrap_angle(error[2]))
            blocks[k] += information
            gradient[k] += information @ error
    if not stops[0].absolute_poses:
        blocks[0] += np.eye(3) / FIXED_VARIANCE
        gradient[0] += (poses[0] - stops[0].pose) / FIXED_VARIANCE
    return block_diagonal(np.array(blocks)), gradient.ravel()
