"""From a disparity image to one measurement per bin of columns: the observation o of stereo-bayes, eq. 2."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import run_in_ranges

UNKNOWN, NONE, MATCHED = 0, 1, 2
STEPS_PER_PX = 2
PEAK_STEPS = 2  # a disparity this many steps below the nearest obstacle's belongs to another obstacle


class HeightBand(NamedTuple):
    """Heights (m) above the floor between which a pixel is an obstacle, and the geometry that gives a pixel its height.

    A pixel with disparity d (px) is `camera_m` + `focal_baseline` / d * `slope` high; `slope` `(rows, cols)`, `focal_baseline`
    in px m.
    """

    slope: NDArray[np.float32]
    focal_baseline: float
    camera_m: float
    low_m: float
    high_m: float


class BinCriteria(NamedTuple):
    """Width of a bin, the largest disparity, and what an obstacle needs.

    `min_extent_px` `(steps,)` is the number of pixels that an obstacle must fill, by disparity in steps of half a pixel.
    `min_matched_ratio` is the fraction of a bin's pixels below which the bin is UNKNOWN. `take_nearest`: the nearest obstacle
    counts, else the most frequent disparity.
    """

    bin_px: int
    max_px: float
    min_extent_px: NDArray[np.float64]
    min_matched_ratio: float
    take_nearest: bool


class Histogram(NamedTuple):
    """Number and sum of the disparities in each step of half a pixel, `(steps,)`."""

    counts: NDArray[np.float64]
    sums: NDArray[np.float64]


def measure_columns(
    disparity: NDArray[np.float32], band: HeightBand, criteria: BinCriteria
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Disparity (px) of the obstacle in each bin `(m,)`, NaN without one, and its status `(m,)`: UNKNOWN, NONE or MATCHED.

    `disparity` `(rows, cols)` in pixels, NaN or not positive without a match. Pixels in the height band are collected in steps
    of half a pixel. A disparity counts if it fills enough pixels; of these the largest (nearest) or the most frequent is taken.
    """
    m = disparity.shape[1] // criteria.bin_px
    found, status = np.full(m, np.nan), np.zeros(m, np.uint8)
    run_in_ranges(_measure_columns, m, (disparity, band, criteria, found, status))
    return found, status


@compiled
def _measure_columns(
    begin: int,
    end: int,
    disparity: NDArray[np.float32],
    band: HeightBand,
    criteria: BinCriteria,
    found: NDArray[np.float64],
    status: NDArray[np.uint8],
) -> None:
    """Fill in the items begin to end - 1 of `measure_columns`."""
    rows = disparity.shape[0]
    bin_px, max_px = criteria.bin_px, criteria.max_px
    steps = int(max_px * STEPS_PER_PX) + 1
    for b in range(begin, end):
        first, last = b * bin_px, (b + 1) * bin_px
        histogram = Histogram(np.zeros(steps), np.zeros(steps))
        counts, sums = histogram
        matched = _collect(histogram, disparity[:, first:last], band.slope[:, first:last], band, max_px)
        if matched < criteria.min_matched_ratio * rows * bin_px:
            continue
        status[b] = NONE
        max_frequent = 0.0
        for step in range(steps - 1, -1, -1):
            low, high = max(step - 1, 0), min(step + 2, steps)
            count = counts[low:high].sum()
            if counts[step] > 0.0 and count >= criteria.min_extent_px[step] and count > max_frequent:
                if (
                    criteria.take_nearest
                    and status[b] == MATCHED
                    and step < int(found[b] * STEPS_PER_PX) - PEAK_STEPS
                ):
                    break  # the peak of the nearest obstacle has been passed
                max_frequent = count
                found[b] = sums[low:high].sum() / count
                status[b] = MATCHED


@compiled
def _collect(
    histogram: Histogram,
    disparity: NDArray[np.float32],
    slope: NDArray[np.float32],
    band: HeightBand,
    max_px: float,
) -> int:
    """Number of matched pixels of a bin `(rows, bin_px)`; adds those in the height band to the histogram."""
    matched = 0
    for v in range(disparity.shape[0]):
        for u in range(disparity.shape[1]):
            d = float(disparity[v, u])
            if not (d > 0.0 and d < max_px):
                continue
            matched += 1
            height = band.camera_m + band.focal_baseline / d * slope[v, u]
            if height > band.low_m and height < band.high_m:
                step = int(d * STEPS_PER_PX)
                histogram.counts[step] += 1.0
                histogram.sums[step] += d
    return matched
