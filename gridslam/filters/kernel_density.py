"""Gaussian kernel density in the plane, by a histogram and a Gaussian filter instead of a sum over all pairs.

P(x) = 1 / (N h^2) sum_i K((x - x_i) / h) with K the normal density of the plane (ispace-mcl, eqs. 5 - 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BINS_PER_BANDWIDTH = 4.0
MARGIN_BANDWIDTHS = 4.0
MAX_BINS = 4_000_000  # largest number of bins: for points far apart the bins grow


@dataclass(frozen=True, slots=True)
class Density:
    """Density (1/m^2) at the centres of square bins `(rows, cols)`; `origin` `(2,)` is the centre of the first bin."""

    values: Floats
    origin: Floats
    bin_m: float

    def at(self, points: Floats) -> Floats:
        """Density `(n,)` at points `(n, 2)`, interpolated bilinearly between the bins; 0 outside."""
        position = ((points - self.origin) / self.bin_m).astype(np.float32)
        grid = self.values.astype(np.float32)
        columns, rows = position[:, 0], position[:, 1]
        outside = (position < 0).any(axis=1) | (columns > grid.shape[1] - 1) | (rows > grid.shape[0] - 1)
        col = np.clip(columns.astype(np.int64), 0, max(grid.shape[1] - 2, 0))
        row = np.clip(rows.astype(np.int64), 0, max(grid.shape[0] - 2, 0))
        u, v = columns - col, rows - row
        low = grid[row, col] * (1 - u) + grid[row, col + 1] * u
        high = grid[row + 1, col] * (1 - u) + grid[row + 1, col + 1] * u
        return np.where(outside, 0.0, low * (1 - v) + high * v).astype(np.float64)


def kernel_density(points: Floats, weights: Floats, bandwidth_m: float) -> Density:
    """The density of points `(n, 2)` with weights `(n,)`, which are normalised.

    Raises ValueError: there are no points.
    """
    if not len(points):
        raise ValueError("no points: no density")
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN_BANDWIDTHS * bandwidth_m
    extent = high - low + 2.0 * margin
    bin_m = max(bandwidth_m / BINS_PER_BANDWIDTH, float(np.sqrt(extent.prod() / MAX_BINS)))
    cols, rows = (int(v) + 2 for v in np.ceil(extent / bin_m))
    origin = low - margin
    position = (points - origin) / bin_m
    corner = position.astype(np.int64)
    part = position - corner
    histogram = np.zeros(rows * cols)
    for dr in (0, 1):  # each point is split over the four bins around it
        for dc in (0, 1):
            fraction = np.abs(1 - dc - part[:, 0]) * np.abs(1 - dr - part[:, 1])
            index = (corner[:, 1] + dr) * cols + corner[:, 0] + dc
            histogram += np.bincount(index, weights * fraction, rows * cols)
    grid = histogram.reshape(rows, cols) / (weights.sum() * bin_m**2)
    # The split has a variance of 1/6 bin^2 already.
    sigma = np.sqrt(max((bandwidth_m / bin_m) ** 2 - 1.0 / 6.0, 0.01))
    smooth = cv2.GaussianBlur(grid, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return Density(np.asarray(smooth), origin, bin_m)
