"""Finds odometry with a wrong scale of distances, by comparison with scan matching over the same windows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MIN_WINDOWS = 20  # smallest number of windows that show the scale
MIN_SCALE_RATIO = 1.12  # smallest error of the scale that is a fault: good odometry is within a tenth
# Smaller errors are only named, if they are in all of some parts of the drive as well
MIN_NAMED_RATIO, MIN_RATIO_OF_PARTS, PARTS = 1.04, 1.02, 5
# Relative; where the ratio varies more, matching has slid along a corridor or wheels have slipped
MAX_SCALE_IQR = 0.2


def wrong_scale(ratios: Floats, weights: Floats) -> float:
    """Factor by which the odometry's distances must be multiplied; 1 without evidence.

    `ratios` `(n,)` of distances by matching to those by odometry have `weights` `(n,)`: the noise of matching lengthens short
    motions, so long ones weigh more.
    """
    middle = _certain_ratio(ratios, weights)
    return middle if max(middle, 1.0 / middle) > MIN_SCALE_RATIO else 1.0


def small_error(ratios: Floats, weights: Floats) -> float:
    """The ratio of distances, by the same ratios and weights, if it certainly differs from 1 by a little; else 1."""
    middle = _certain_ratio(ratios, weights)
    if max(middle, 1.0 / middle) < MIN_NAMED_RATIO:
        return 1.0
    parts = [
        _weighted_quartiles(*part)[1]
        for part in zip(np.array_split(ratios, PARTS), np.array_split(weights, PARTS), strict=True)
    ]
    smallest = min(parts) if middle > 1.0 else 1.0 / max(parts)
    return middle if smallest > MIN_RATIO_OF_PARTS else 1.0


def _certain_ratio(ratios: Floats, weights: Floats) -> float:
    """The median ratio; 1 if there are few ratios, or if they vary."""
    if len(ratios) < MIN_WINDOWS:
        return 1.0
    low, middle, high = _weighted_quartiles(ratios, weights).tolist()
    return middle if high - low < MAX_SCALE_IQR * middle else 1.0


def _weighted_quartiles(values: Floats, weights: Floats) -> Floats:
    """Quartiles `(3,)` of values `(n,)` with weights `(n,)`."""
    order = np.argsort(values)
    fractions = np.cumsum(weights[order]) / weights.sum()
    return np.asarray(values[order][np.searchsorted(fractions, [0.25, 0.5, 0.75])])
