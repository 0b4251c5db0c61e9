"""Point-to-plane ICP between a former scan and the present one (handmap-slam, 6.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

_SETTLED = 1e-4


@dataclass(frozen=True, slots=True)
class IcpResult:
    """T_former_present `(3,)`, its information `(3, 3)` per squared metre of residual, and how many points found a partner."""

    pose: Floats
    information: Floats
    matches: int


def point_to_plane(
    points: Floats,
    former: Floats,
    normals: Floats,
    start: Floats,
    max_correspondence_m: float,
    sigma_m: float,
    prior_information: Floats,
    iterations: int = 15,
    solve_yaw: bool = True,
) -> IcpResult:
    """Register points `(m, 2)` of the present scan to `former` points `(n, 2)` with unit `normals` `(n, 2)` (zero: unknown).

    Minimises sum ||n_i . (y_i - (R x_i + T))||^2 / sigma^2 in at most `iterations`, with the `start` `(3,)` as prior of the
    information `prior_information` `(3, 3)`: what no wall determines, as the position along a bare corridor, stays as the prior
    has it. Without `solve_yaw` the rotation is held, as in the paper, where it comes from lines. `matches` of the result counts
    the correspondences, which are at most `max_correspondence_m` (m) apart; with fewer than three the start is returned.
    `sigma_m` (m) is the noise of a point.
    """
    flat = np.hypot(normals[:, 0], normals[:, 1]) > 0.5
    target, normals = former[flat], normals[flat]
    pose = np.array(start, np.float64)
    information, matches = np.array(prior_information, np.float64), 0
    if not len(target) or not len(points):
        return IcpResult(pose, information, 0)
    tree = cKDTree(target)
    dims = 3 if solve_yaw else 2
    for index in range(iterations):
        moved = se2.transform_points(pose, points)
        max_correspondence = max_correspondence_m if index < iterations // 2 else 0.5 * max_correspondence_m
        distance, partner = tree.query(moved, distance_upper_bound=max_correspondence)
        found = np.isfinite(distance)
        matches = int(found.sum())
        if matches < 3:
            return IcpResult(np.array(start, np.float64), np.array(prior_information, np.float64), matches)
        normal = normals[partner[found]]
        residual = (normal * (target[partner[found]] - moved[found])).sum(axis=1)
        weight = 1.0 / (1.0 + (residual / (2.0 * sigma_m)) ** 2) ** 2 / sigma_m**2
        arm = moved[found] - pose[:2]
        jacobian = np.column_stack([normal, normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]])
        information = prior_information + (jacobian * weight[:, None]).T @ jacobian
        off = pose - start
        off[2] = float(se2.wrap_angle(off[2]))
        gradient = jacobian.T @ (weight * residual) - prior_information @ off
        step = np.zeros(3)
        step[:dims] = np.linalg.solve(information[:dims, :dims], gradient[:dims])
        pose = pose + step
        if float(np.abs(step).max()) < _SETTLED and index >= iterations // 2:
            break
    pose[2] = float(se2.wrap_angle(pose[2]))
    return IcpResult(pose, information, matches)
