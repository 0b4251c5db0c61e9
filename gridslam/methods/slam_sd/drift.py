"""How far a path may have drifted since its anchor, and the most likely path when its end turns out to be elsewhere.

The steps of the path have independent errors in x, y and yaw. An error of the heading at one pose swings all that follows about
it; so the covariance of the end, and how a correction of the end is shared out over the path, follow in closed form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

LEAST_DEVIATIONS = np.array([1e-3, 1e-3, 5e-4])
BENDING_ITERATIONS = 2


class Drift:
    """Covariance `(n, 3, 3)` of each particle's pose in the map frame, given its pose at the key scan `anchor` `(n,)`."""

    def __init__(self, n: int) -> None:
        self.covariance = np.zeros((n, 3, 3))
        self.anchor = np.zeros(n, np.int64)
        self.untied_steps = np.zeros(n, np.int64)

    def grow(self, before: Floats, after: Floats, deviations: Floats) -> None:
        """One more step from poses `before` to `after` `(n, 3)`, with standard deviations (3,) in the robot's frame."""
        moved = np.tile(np.eye(3), (len(before), 1, 1))
        moved[:, 0, 2] = -(after[:, 1] - before[:, 1])
        moved[:, 1, 2] = after[:, 0] - before[:, 0]
        self.covariance = moved @ self.covariance @ moved.transpose(0, 2, 1) + np.diag(deviations**2)
        self.untied_steps += 1

    def information(self, floor: Floats = LEAST_DEVIATIONS) -> Floats:
        """The inverse covariances `(n, 3, 3)`, those of `floor` (3,) added."""
        return np.asarray(np.linalg.inv(self.covariance + np.diag(floor**2)))

    def sample(self, rng: np.random.Generator, floor: Floats = LEAST_DEVIATIONS) -> Floats:
        """One offset (x, y, yaw) for each particle `(n, 3)`, in the map frame; the variances of `floor` (3,) are added."""
        root = np.linalg.cholesky(self.covariance + np.diag(floor**2))
        return np.asarray(np.einsum("nij,nj->ni", root, rng.standard_normal(self.covariance.shape[:2])))

    def tie(self, tied: NDArray[np.bool_], information: Floats, key: int, anchored_m: float) -> None:
        """Scans with the given information `(n, 3, 3)` have tied these particles to their maps at key scan `key`.

        Where that leaves the position certain to `anchored_m`, a new path begins.
        """
        posterior = np.linalg.inv(self.information() + information)
        self.covariance[tied] = posterior[tied]
        self.untied_steps[tied] = 0
        widest = np.linalg.eigvalsh(posterior[:, :2, :2])[:, 1]
        self.anchor[tied & (widest < anchored_m**2)] = key

    def select(self, ancestors: NDArray[np.int64]) -> None:
        """Resampling: particle i becomes a copy of ancestors[i]."""
        self.covariance = self.covariance[ancestors]
        self.anchor = self.anchor[ancestors]
        self.untied_steps = self.untied_steps[ancestors]


def bend(path: Floats, end: Floats, deviations: Floats) -> Floats:
    """The most likely path `(k, 3)` that starts where `path` does and ends at `end` (3,).

    `deviations` `(k - 1, 3)` are the standard deviations of its steps (x, y alike, yaw) in the robot's frame. This is the
    conditional mean of the path given its end, linearised about the last iteration.
    """
    bent = path.copy()
    variance_xy, variance_yaw = deviations[:, 0] ** 2, deviations[:, 2] ** 2
    for _ in range(BENDING_ITERATIONS):
        missing = end - bent[-1]
        missing[2] = se2.wrap_angle(missing[2])
        arm = np.stack(
            [-(bent[-1, 1] - bent[1:, 1]), bent[-1, 0] - bent[1:, 0], np.ones(len(bent) - 1)], axis=1
        )
        covariance = np.einsum("k,ki,kj->ij", variance_yaw, arm, arm)
        covariance[0, 0] += variance_xy.sum()
        covariance[1, 1] += variance_xy.sum()
        multiplier = np.linalg.solve(covariance, missing)
        turn = variance_yaw * (arm @ multiplier)
        shift = variance_xy[:, None] * multiplier[:2]
        bent = _perturb(bent, shift, turn)
    return bent


def _perturb(path: Floats, shift: Floats, turn: Floats) -> Floats:
    """The path when pose k + 1 is moved by shift[k] (map frame) and turned by turn[k], and all later ones with it."""
    turned = np.concatenate([[0.0], np.cumsum(turn)])
    c, s = np.cos(turned[:-1]), np.sin(turned[:-1])
    dx, dy = np.diff(path[:, 0]), np.diff(path[:, 1])
    steps = np.stack([c * dx - s * dy, s * dx + c * dy], axis=1) + shift
    out = path.copy()
    out[1:, :2] = path[0, :2] + np.cumsum(steps, axis=0)
    out[:, 2] = se2.wrap_angle(path[:, 2] + turned)
    return out
