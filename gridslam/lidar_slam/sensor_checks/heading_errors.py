"""Finds odometry whose rotations are wrong in scale, or grow with the distance or with time, by the motion of scan matching."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

# Smallest errors that are corrected: good odometry is wrong by some percent, and its wheels differ by some millimetres.
MIN_SCALE_ERROR = 0.08
# Largest scale, and inverse of the smallest: beyond, odometry shows nothing about the rotations
MAX_SCALE = 5.0
MIN_PER_M_RAD = math.radians(3.0)
MIN_PER_S_RAD = math.radians(1.0)
MIN_ERRORS = np.array([MIN_SCALE_ERROR, MIN_PER_M_RAD, MIN_PER_S_RAD])
NEUTRAL = np.array([1.0, 0.0, 0.0])
MIN_SIGNIFICANCE = 4.0  # smallest error, in its standard deviations
# Difference beyond which a window weighs less: wheels slip, matching slides
OUTLIER_RAD, ITERATIONS = 0.02, 10
MIN_COMMON_ROTATION = 0.3  # smallest rotation by odometry, relative to the matched one: less shows no scale
MAX_RESIDUAL_RATIO = 0.7  # largest ratio of the mean difference after the correction to that before


@dataclass(frozen=True, slots=True)
class HeadingErrors:
    """Errors of odometry: true rotation = `scale` * rotation + `per_m_rad` * forward distance + `per_s_rad` * duration."""

    scale: float = 1.0
    per_m_rad: float = 0.0
    per_s_rad: float = 0.0

    @property
    def faults(self) -> list[str]:
        """The faults in words; empty if there are none."""
        found = []
        if self.scale != 1.0:
            found.append(f"its rotations are {1.0 / self.scale:.2f} of the true ones (wrong wheel base?)")
        if self.per_m_rad:
            per_m = math.degrees(self.per_m_rad)
            found.append(
                f"its heading drifts by {abs(per_m):.1f} deg per metre to the {_side(per_m)} (unequal wheels?)"
            )
        if self.per_s_rad:
            per_s = math.degrees(self.per_s_rad)
            found.append(
                f"its heading drifts by {abs(per_s):.1f} deg per second to the {_side(per_s)} (gyro bias?)"
            )
        return found

    def removed_from(self, times_s: Floats, poses: Floats) -> Floats:
        """The odometry path `(n, 3)` at times `(n,)` integrated with corrected rotations; it starts at the same pose."""
        if self == NO_ERRORS or len(poses) < 2:
            return poses
        steps = se2.between(poses[:-1], poses[1:])
        steps[:, 2] = se2.wrap_angle(steps[:, 2])
        rotations = (
            self.scale * steps[:, 2] + self.per_m_rad * steps[:, 0] + self.per_s_rad * np.diff(times_s)
        )
        yaws = poses[0, 2] + np.concatenate([[0.0], np.cumsum(rotations)])
        # The chord of an arc has half its rotation.
        directions = yaws[:-1] + 0.5 * (rotations - steps[:, 2])
        cos, sin = np.cos(directions), np.sin(directions)
        moved = np.column_stack(
            [cos * steps[:, 0] - sin * steps[:, 1], sin * steps[:, 0] + cos * steps[:, 1]]
        )
        places = poses[0, :2] + np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
        return np.column_stack([places, yaws])


NO_ERRORS = HeadingErrors()


def find_heading_errors(progress: Floats, matched_rad: Floats, independent: float) -> HeadingErrors:
    """The errors of odometry by matched rotations `(n,)`; only those that are certain.

    `progress` `(n, 3)` are the odometry's rotation (rad), its distance forward (m), and the time (s) of the same motions, of
    which `independent` do not overlap.
    """
    common = float(np.abs(matched_rad).sum())
    if not common or np.abs(progress[:, 0]).sum() < MIN_COMMON_ROTATION * common:
        return NO_ERRORS
    chosen: list[int] = []
    errors = np.zeros(3)
    while len(chosen) < len(NEUTRAL):
        left = matched_rad - progress @ (NEUTRAL + errors)
        tried = {k: _without(progress, left, k, independent) for k in range(len(NEUTRAL)) if k not in chosen}
        best = min(tried, key=lambda k: tried[k])
        if tried[best] > MAX_RESIDUAL_RATIO:
            break
        chosen.append(best)
        errors[chosen], _ = _robust_factors(
            progress[:, chosen], matched_rad - progress @ NEUTRAL, independent
        )
    scale, per_m, per_s = (NEUTRAL + errors).tolist()
    is_small = (np.abs(errors[chosen]) < MIN_ERRORS[chosen]).any()
    if not chosen or is_small or not 1.0 / MAX_SCALE < scale < MAX_SCALE:
        return NO_ERRORS
    return HeadingErrors(scale, per_m, per_s)


def _without(progress: Floats, left_rad: Floats, k: int, independent: float) -> float:
    """Fraction of the differences `(n,)` that remains after removal of error k; 1 if error k is small or uncertain.

    Motions count by how much of the error would show in them.
    """
    factor, std = _robust_factors(progress[:, [k]], left_rad, independent)
    if abs(factor[0]) < max(MIN_ERRORS[k], MIN_SIGNIFICANCE * std[0]):
        return 1.0
    weights = np.abs(progress[:, k])
    remaining = np.abs(left_rad - factor[0] * progress[:, k])
    return float((weights * remaining).sum() / (weights * np.abs(left_rad)).sum())


def _robust_factors(columns: Floats, values: Floats, independent: float) -> tuple[Floats, Floats]:
    """Factors `(k,)` of columns `(n, k)` that give values `(n,)`, and their standard deviations `(k,)`; outliers weigh less."""
    weights: Floats = np.ones(len(values))
    factors: Floats = np.zeros(columns.shape[1])
    normal: Floats = np.eye(columns.shape[1])
    for _ in range(ITERATIONS):
        weighted = columns * weights[:, None]
        normal = weighted.T @ columns
        factors = np.asarray(np.linalg.lstsq(normal, weighted.T @ values, rcond=None)[0], np.float64)
        residuals = np.abs(values - columns @ factors)
        weights = np.asarray(1.0 / np.maximum(residuals / OUTLIER_RAD, 1.0))
    variance = float((weights * residuals**2).sum() / max(float(weights.sum()), 1e-9)) + 1e-12
    spare = max(len(values) / max(independent, 1.0), 1.0)
    return factors, np.sqrt(np.abs(np.diag(np.linalg.pinv(normal))) * variance * spare)


def _side(correction_deg: float) -> str:
    """The side, `left` or `right`, to which the odometry drifts if it needs this correction."""
    return "right" if correction_deg > 0.0 else "left"
