"""From a disparity image to one measurement for every bin of columns: the observation o of stereo-bayes' eq. 2."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled_parallel

UNKNOWN, NONE, MATCHED = 0, 1, 2
STEPS_PER_PX = 2


@compiled_parallel
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
    take_nearest: bool,
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """The disparity of the first obstacle `(m,)`, and whether there is one `(m,)` (UNKNOWN, NONE, MATCHED).

    `disparity` `(rows, cols)` in pixels, NaN or not positive without match; a pixel with disparity d is `mount_m` +
    focal_baseline / d * `slope` high. Pixels between low and high are collected in steps of half a pixel; a disparity counts when
    it fills as many pixels as `least_extent_px` `(steps,)` asks at this disparity. Of those the largest (nearest) is taken, or
    the most frequent one. UNKNOWN: less than `least_share` of the bin's pixels have a match at all.
    """
    rows, cols = disparity.shape
    m = cols // bin_px
    steps = int(most_px * STEPS_PER_PX) + 1
    found, status = np.full(m, np.nan), np.zeros(m, np.uint8)
    for b in prange(m):
        counts, sums = np.zeros(steps), np.zeros(steps)
        matched = 0
        for v in range(rows):
            for u in range(b * bin_px, (b + 1) * bin_px):
                d = float(disparity[v, u])
                if not (d > 0.0 and d < most_px):
                    continue
                matched += 1
                height = mount_m + focal_baseline / d * slope[v, u]
                if height > low_m and height < high_m:
                    step = int(d * STEPS_PER_PX)
                    counts[step] += 1.0
                    sums[step] += d
        if matched < least_share * rows * bin_px:
            continue
        status[b] = NONE
        best = 0.0
        for step in range(steps - 1, -1, -1):
            low, high = max(step - 1, 0), min(step + 2, steps)
            near = counts[low:high].sum()
            if counts[step] > 0.0 and near >= least_extent_px[step] and near > best:
                if take_nearest and status[b] == MATCHED and step < int(found[b] * STEPS_PER_PX) - 2:
                    break  # the peak of the nearest one has been passed
                best = near
                found[b] = sums[low:high].sum() / near
                status[b] = MATCHED
    return found, status
