"""Pose graphs: robust least squares over relative poses.

Nodes are poses `(n, 3)` in the map frame. An edge measures the pose of node `target` in the frame of node `source`, with an
information matrix (3, 3) in that frame. Loop edges may be wrong and are weighted by a robust kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

CONVERGED = 1e-5  # largest change of a coordinate (m, rad) in the last iteration
MAX_ITERATIONS = 20


@dataclass(frozen=True, slots=True)
class Edges:
    """`source`, `target` int `(m,)`; `T_source_target` `(m, 3)`; `information` `(m, 3, 3)`; `is_loop` bool `(m,)`."""

    source: NDArray[np.int64]
    target: NDArray[np.int64]
    T_source_target: Floats
    information: Floats
    is_loop: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.source)

    def select(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Edges:
        """The edges of these rows: indices `(k,)` or a mask `(m,)`."""
        return Edges(
            self.source[rows],
            self.target[rows],
            self.T_source_target[rows],
            self.information[rows],
            self.is_loop[rows],
        )

    @staticmethod
    def none() -> Edges:
        """No edges."""
        no_nodes = np.zeros(0, np.int64)
        return Edges(no_nodes, no_nodes, np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, np.bool_))

    @staticmethod
    def concatenate(parts: Sequence[Edges]) -> Edges:
        """The edges of all parts, in order."""
        return Edges(
            np.concatenate([p.source for p in parts]),
            np.concatenate([p.target for p in parts]),
            np.concatenate([p.T_source_target for p in parts]),
            np.concatenate([p.information for p in parts]),
            np.concatenate([p.is_loop for p in parts]),
        )


def residuals(poses: Floats, edges: Edges) -> Floats:
    """Errors `(m, 3)` of the edges in the source's frame: estimated minus measured relative pose, yaw wrapped."""
    error = se2.between(poses[edges.source], poses[edges.target]) - edges.T_source_target
    error[:, 2] = se2.wrap_angle(error[:, 2])
    return np.asarray(error)


def chi_squared(poses: Floats, edges: Edges) -> Floats:
    """Squared Mahalanobis distances `(m,)` of the errors."""
    error = residuals(poses, edges)
    return np.asarray(np.einsum("mi,mij,mj->m", error, edges.information, error))


def jacobians(poses: Floats, edges: Edges) -> tuple[Floats, Floats]:
    """Derivatives `(m, 3, 3)` of the errors with respect to the source's and to the target's pose."""
    a, b = poses[edges.source], poses[edges.target]
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    source = np.zeros((len(edges), 3, 3))
    target = np.zeros((len(edges), 3, 3))
    target[:, 0, 0], target[:, 0, 1], target[:, 1, 0], target[:, 1, 1], target[:, 2, 2] = c, s, -s, c, 1.0
    source[:, :2, :2] = -target[:, :2, :2]
    source[:, 0, 2] = -s * dx + c * dy
    source[:, 1, 2] = -c * dx - s * dy
    source[:, 2, 2] = -1.0
    return source, target


def robust_weights(chi2: Floats, is_loop: NDArray[np.bool_], scale: float) -> Floats:
    """Geman-McClure weights `(m,)` of loops: 1 for a perfect loop, 1/4 at chi2 = scale^2. Other edges weigh 1."""
    weights = 1.0 / (1.0 + chi2 / scale**2) ** 2
    return np.where(is_loop, weights, 1.0)


def optimise(
    poses: Floats, edges: Edges, robust_scale: float, max_iterations: int = MAX_ITERATIONS
) -> tuple[Floats, Floats]:
    """Optimised poses `(n, 3)` and final robust weights of the edges `(m,)`; node 0 is held.

    Gauss-Newton with iteratively reweighted loops. The scale of the robust kernel (in standard deviations) starts wide and is
    halved down to `robust_scale` (graduated non-convexity, Yang et al. 2020), so that one wrong loop does not decide
    which others look right.
    """
    estimate = np.array(poses, dtype=np.float64)
    chi2 = chi_squared(estimate, edges)
    largest = float(np.sqrt(chi2[edges.is_loop].max())) if edges.is_loop.any() else robust_scale
    scale = max(robust_scale, 2.0 * largest)
    weights = robust_weights(chi2, edges.is_loop, scale)
    for _ in range(max_iterations):
        step = _solve_step(estimate, edges, weights)
        estimate += step
        estimate[:, 2] = se2.wrap_angle(estimate[:, 2])
        converged = bool(np.abs(step).max() < CONVERGED)
        if converged and scale <= robust_scale:
            break
        scale = max(0.5 * scale, robust_scale)
        weights = robust_weights(chi_squared(estimate, edges), edges.is_loop, scale)
    return estimate, weights


def normal_equations(
    poses: Floats, edges: Edges, weights: Floats | None = None
) -> tuple[sparse.csc_matrix, Floats]:
    """Hessian `(3n, 3n)` and gradient `(3n,)` of half the sum of the edges' squared errors, with weights `(m,)` (default 1)."""
    n = len(poses)
    error = residuals(poses, edges)
    source, target = jacobians(poses, edges)
    weighted = edges.information if weights is None else edges.information * weights[:, None, None]
    blocks, rows, cols = [], [], []
    gradient = np.zeros((n, 3))
    for left, i in ((source, edges.source), (target, edges.target)):
        projected = np.einsum("mki,mkl->mil", left, weighted)
        np.add.at(gradient, i, np.einsum("mil,ml->mi", projected, error))
        for right, j in ((source, edges.source), (target, edges.target)):
            blocks.append(np.einsum("mil,mlj->mij", projected, right))
            rows.append(np.broadcast_to(3 * i[:, None, None] + np.arange(3)[None, :, None], (len(i), 3, 3)))
            cols.append(np.broadcast_to(3 * j[:, None, None] + np.arange(3)[None, None, :], (len(i), 3, 3)))
    hessian = sparse.coo_matrix(
        (np.concatenate(blocks).ravel(), (np.concatenate(rows).ravel(), np.concatenate(cols).ravel())),
        shape=(3 * n, 3 * n),
    ).tocsc()
    return hessian, gradient.ravel()


def factorised(matrix: sparse.csc_matrix) -> SuperLU:
    """The factors of a sparse positive definite matrix.

    It needs no pivoting; without any the order that keeps the factors sparse is followed, and a large graph takes a twentieth of
    the time.
    """
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _solve_step(poses: Floats, edges: Edges, weights: Floats) -> Floats:
    """Gauss-Newton step `(n, 3)` of all poses; node 0 is held."""
    hessian, gradient = normal_equations(poses, edges, weights)
    step = np.zeros(3 * len(poses))
    step[3:] = factorised(hessian[3:, 3:]).solve(-gradient[3:])
    return step.reshape(-1, 3)
