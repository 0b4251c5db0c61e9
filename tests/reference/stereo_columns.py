"""One measurement for every bin of columns of a disparity image, with a histogram by numpy for each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

UNKNOWN, NONE, MATCHED = 0, 1, 2


def measure_columns(
    disparity: NDArray[np.float32],
    slope: NDArray[np.float32],
    focal_baseline: float,
    mount_m: float,
    low_m: float,
    high_m: float,
    bin_px: int,
    most_px: float,
    least_extent_px: NDArray[np.float64],
    least_share: float,
) -> list[tuple[float, int]]:
    """The most frequent disparity of each bin, of two that are alike the nearer, and whether there is any.

    A disparity counts when three half pixels about it hold as many pixels of the height looked at as `least_extent_px` asks.
    """
    found = []
    for b in range(disparity.shape[1] // bin_px):
        columns = slice(b * bin_px, (b + 1) * bin_px)
        d, rise = disparity[:, columns].astype(np.float64), slope[:, columns]
        matched = (d > 0.0) & (d < most_px)
        if matched.sum() < least_share * d.size:
            found.append((np.nan, UNKNOWN))
            continue
        d, rise = d[matched], rise[matched]
        height = mount_m + focal_baseline / d * rise
        d = d[(height > low_m) & (height < high_m)]
        steps = (2.0 * d).astype(int)
        windows = {step: d[np.abs(steps - step) <= 1] for step in set(steps.tolist())}
        enough = [step for step, window in windows.items() if len(window) >= least_extent_px[step]]
        if not enough:
            found.append((np.nan, NONE))
            continue
        best = max(enough, key=lambda step: (len(windows[step]), step))
        found.append((float(windows[best].mean()), MATCHED))
    return found
