"""One measurement for every bin of columns of a disparity image, by a numpy histogram for each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.stereo.stereo_columns import BinCriteria, HeightBand

UNKNOWN, NONE, MATCHED = 0, 1, 2


def measure_columns(
    disparity: NDArray[np.float32], band: HeightBand, criteria: BinCriteria
) -> list[tuple[float, int]]:
    """The most frequent disparity of each bin, the nearest if several are equally frequent, and its status.

    A disparity counts if the three half pixels around it hold at least `min_extent_px` pixels in the height band.
    """
    found = []
    bin_px = criteria.bin_px
    for b in range(disparity.shape[1] // bin_px):
        columns = slice(b * bin_px, (b + 1) * bin_px)
        d, rise = disparity[:, columns].astype(np.float64), band.slope[:, columns]
        matched = (d > 0.0) & (d < criteria.max_px)
        if matched.sum() < criteria.min_matched_ratio * d.size:
            found.append((np.nan, UNKNOWN))
            continue
        d, rise = d[matched], rise[matched]
        height = band.camera_m + band.focal_baseline / d * rise
        d = d[(height > band.low_m) & (height < band.high_m)]
        steps = (2.0 * d).astype(int)
        windows = {step: d[np.abs(steps - step) <= 1] for step in set(steps.tolist())}
        enough = [step for step, window in windows.items() if len(window) >= criteria.min_extent_px[step]]
        if not enough:
            found.append((np.nan, NONE))
            continue
        best = max(enough, key=lambda step: (len(windows[step]), step))
        found.append((float(windows[best].mean()), MATCHED))
    return found
