"""The rigid motion of the plane that carries an estimate's frame into the truth's."""

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
    """Positions p of the estimate become `scale * p` moved by `T_truth_estimate` (x, y, yaw)."""

    T_truth_estimate: NDArray[np.float64]
    scale: float = 1.0

    def apply(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses `(n, 3)` in the truth's frame."""
        return se2.compose(self.T_truth_estimate, poses * [self.scale, self.scale, 1.0])


def find_alignment(
    estimate: NDArray[np.float64], truth: NDArray[np.float64], align: Align, with_scale: bool = False
) -> Alignment | None:
    """The alignment of paired poses `(n, 3)`; None where the pairs do not determine it.

    `origin` puts the first estimated pose on its true one; `se2` is Umeyama's least-squares fit of the positions
    (PAMI 1991) in the plane, with the scale only when asked for. On planar data evo's fit in space is the same
    unless turning the plane over fits better, which no robot can do.
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
    turned = se2.transform_points(np.array([0.0, 0.0, yaw]), scale * source_mean[None, :])[0]
    shift = target_mean - turned
    return Alignment(np.array([shift[0], shift[1], yaw]), scale)
