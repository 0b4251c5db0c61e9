"""Drift of a path since its last certain match (the anchor), and the most likely path after its end has been corrected.

The steps of the path have independent errors in x, y and yaw. An error of the heading at one pose rotates the rest of the path
about that pose. The covariance of the end, and the distribution of a correction of the end over the path, follow in closed form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

MIN_STD = np.array([1e-3, 1e-3, 5e-4])  # added to the drift (x, y, yaw): keeps its covariance invertible
MATCHED_STD_M = 0.1  # a match that determines the position to this is the anchor of what follows
ITERATIONS = 2  # number of linearisations


class Drift:
    """Covariance `(n, 3, 3)` of each particle's pose in the map frame, given its pose at the key scan `anchor` `(n,)`."""

    def __init__(self, n: int) -> None:
        self.covariance = np.zeros((n, 3, 3))
        self.anchor = np.zeros(n, np.int64)
        self.unmatched_key_scans = np.zeros(n, np.int64)

    def add_step(self, before: Floats, after: Floats, step_std: Floats) -> None:
        """Compound a step from poses `before` to `after` `(n, 3)` with standard deviations (3,) in the robot's frame."""
        jacobian = se2.turning_jacobian(after[:, :2] - before[:, :2])
        propagated = jacobian @ self.covariance @ jacobian.transpose(0, 2, 1)
        self.covariance = propagated + np.diag(step_std**2)
        self.unmatched_key_scans += 1

    def information(self, floor_std: Floats = MIN_STD) -> Floats:
        """Inverse covariances `(n, 3, 3)`, after the variances of `floor_std` (3,) are added."""
        return np.asarray(np.linalg.inv(self.covariance + np.diag(floor_std**2)))

    def sample(self, rng: np.random.Generator, floor_std: Floats = MIN_STD) -> Floats:
        """One offset (x, y, yaw) `(n, 3)` per particle in the map frame; the variances of `floor_std` (3,) are added."""
        root = np.linalg.cholesky(self.covariance + np.diag(floor_std**2))
        return np.asarray(np.einsum("nij,nj->ni", root, rng.standard_normal(self.covariance.shape[:2])))

    def add_match(self, is_matched: NDArray[np.bool_], information: Floats, key: int) -> None:
        """Update the matched particles `(n,)` with their matches' information `(n, 3, 3)` at key scan `key`.

        A match that determines the position to `MATCHED_STD_M` becomes the anchor.
        """
        posterior = np.linalg.inv(self.information() + information)
        self.covariance[is_matched] = posterior[is_matched]
        self.unmatched_key_scans[is_matched] = 0
        largest_variance = np.linalg.eigvalsh(posterior[:, :2, :2])[:, 1]
        self.anchor[is_matched & (largest_variance < MATCHED_STD_M**2)] = key

    def select(self, ancestors: NDArray[np.int64]) -> None:
        """Resampling: particle i becomes a copy of ancestors[i]; `ancestors` `(n,)`."""
        self.covariance = self.covariance[ancestors]
        self.anchor = self.anchor[ancestors]
        self.unmatched_key_scans = self.unmatched_key_scans[ancestors]


def deformed_path(path: Floats, end: Floats, step_std: Floats) -> Floats:
    """The most likely path `(k, 3)` that starts where `path` does and ends at the pose `end` (3,).

    `step_std` `(k - 1, 3)` are the standard deviations of the steps (x and y equal, yaw) in the robot's frame. The result is
    the conditional mean of the path given its end, linearised about the last iteration.
    """
    deformed = path.copy()
    variance_xy, variance_yaw = step_std[:, 0] ** 2, step_std[:, 2] ** 2
    for _ in range(ITERATIONS):
        missing = end - deformed[-1]
        missing[2] = se2.wrap_angle(missing[2])
        last, rest = deformed[-1], deformed[1:]
        lever = np.stack([-(last[1] - rest[:, 1]), last[0] - rest[:, 0], np.ones(len(rest))], axis=1)
        covariance = np.einsum("k,ki,kj->ij", variance_yaw, lever, lever)
        covariance[0, 0] += variance_xy.sum()
        covariance[1, 1] += variance_xy.sum()
        multiplier = np.linalg.solve(covariance, missing)
        rotations = variance_yaw * (lever @ multiplier)
        translations = variance_xy[:, None] * multiplier[:2]
        deformed = _perturbed(deformed, translations, rotations)
    return deformed


def _perturbed(path: Floats, translations: Floats, rotations: Floats) -> Floats:
    """The path after step k is translated (map frame) `(k - 1, 2)` and rotated `(k - 1,)` at its end; later poses follow."""
    yaw = np.concatenate([[0.0], np.cumsum(rotations)])
    c, s = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    dx, dy = np.diff(path[:, 0]), np.diff(path[:, 1])
    steps = np.stack([c * dx - s * dy, s * dx + c * dy], axis=1) + translations
    out = path.copy()
    out[1:, :2] = path[0, :2] + np.cumsum(steps, axis=0)
    out[:, 2] = se2.wrap_angle(path[:, 2] + yaw)
    return out
