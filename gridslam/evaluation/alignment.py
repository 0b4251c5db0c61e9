"""The planar rigid transform (with optional scale) from an estimate's frame to the frame of the ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Align = Literal["none", "se2", "origin"]
_DEGENERATE = 1e-12


@dataclass(frozen=True, slots=True)
class Alignment:
    """Maps a position p of the estimate to `T_truth_estimate` (x, y, yaw) applied to `scale * p`."""

    T_truth_estimate: NDArray[np.float64]
    scale: float = 1.0

    def apply(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """The poses `(n, 3)` transformed into the frame of the ground truth."""
        return se2.compose(self.T_truth_estimate, poses * [self.scale, self.scale, 1.0])


def find_alignment(
    estimate: NDArray[np.float64], truth: NDArray[np.float64], align: Align, with_scale: bool = False
) -> Alignment | None:
    """The alignment of paired poses `(n, 3)`, or None if the pairs do not determine it.

    `none` is the identity. `origin` moves the first estimated pose onto the true one. `se2` is Umeyama's least-squares
    alignment of the positions (PAMI 1991) in the plane, with a scale if `with_scale`. evo aligns in space: for planar data
    the result is the same unless flipping the plane gives a smaller error.
    """
    if align == "none":
        return Alignment(np.zeros(3))
    if not len(estimate):
        return None
    if align == "origin":
        return Alignment(se2.compose(truth[0], se2.inverse(estimate[0])))
    return _umeyama(estimate[:, :2], truth[:, :2], with_scale)


def _umeyama(source: NDArray[np.float64], target: NDArray[np.float64], with_scale: bool) -> Alignment | None:
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    s, t = source - source_mean, target - target_mean
    cos_sum = float((s * t).sum())
    sin_sum = float((s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum())
    strength = float(np.hypot(cos_sum, sin_sum))
    if not strength > _DEGENERATE * len(source):
        return None
    yaw = float(np.arctan2(sin_sum, cos_sum))
    scale = strength / float((s**2).sum()) if with_scale else 1.0
    rotated = se2.transform_points(np.array([0.0, 0.0, yaw]), scale * source_mean[None, :])[0]
    shift = target_mean - rotated
    return Alignment(np.array([shift[0], shift[1], yaw]), scale)
