"""Evens out stamps of messages that were measured evenly, but stamped on arrival: a line through them is closer to the truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]
Floats = NDArray[np.float64]

MIN_STAMPS = 400  # smallest number of stamps that shows whether messages were measured evenly
PART = 100  # number of stamps of a part, to which a separate line is fitted
# Smallest mean difference of the steps from the median step, relative to it, that is jitter
MIN_UNEVENNESS = 0.25
# Largest ratio of the deviations from one line to those from the lines of the parts: it grows where messages are missing, or were
# not made evenly, since then the deviations add up
MAX_GLOBAL_RATIO = 1.15
# Skewness ((mean - median) / standard deviation) from which on the deviations are delays, which are never negative, and the
# quantile of them that is none
MIN_SKEWNESS, NO_DELAY = 0.12, 0.05


def evened(stamps: Stamps) -> tuple[Stamps, float] | None:
    """Even stamps `(n,)` (ns) for those that jitter, and their jitter (s); None if they do not, or were not even."""
    if len(stamps) < MIN_STAMPS:
        return None
    seconds = (stamps - stamps[0]) * 1e-9
    steps = np.diff(seconds)
    period_s = float(seconds[-1] - seconds[0]) / len(steps)
    if period_s <= 0.0 or np.abs(steps - np.median(steps)).mean() < MIN_UNEVENNESS * period_s:
        return None
    numbers = np.arange(len(stamps), dtype=np.float64)
    line = _line(numbers, seconds)
    deviations = seconds - line
    parts = [
        float(np.std(seconds[k : k + PART] - _line(numbers[:PART], seconds[k : k + PART])))
        for k in range(0, len(stamps) - PART + 1, PART)
    ]
    std_s = float(deviations.std())
    if std_s > MAX_GLOBAL_RATIO * float(np.median(parts)):
        return None
    middle = float(np.median(deviations))
    is_delay = -middle > MIN_SKEWNESS * std_s  # the mean is 0
    offset_s = float(np.quantile(deviations, NO_DELAY)) if is_delay else middle
    return stamps[0] + np.round((line + offset_s) * 1e9).astype(np.int64), std_s


def _line(numbers: Floats, values: Floats) -> Floats:
    """The values `(n,)` at numbers `(n,)` on the straight line that fits them best."""
    slope, start = np.polyfit(numbers, values, 1)
    return np.asarray(start + slope * numbers)
