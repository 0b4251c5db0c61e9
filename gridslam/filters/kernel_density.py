"""Gaussian kernel density in the plane, binned: a histogram and a Gaussian filter instead of a sum over all pairs.

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
MOST_BINS = 4_000_000  # where points lie far apart the bins grow to stay below this


@dataclass(frozen=True, slots=True)
class Density:
    """Values per m^2 at the centres of square bins `(rows, cols)`, `origin` being the centre of the first."""

    values: Floats
    origin: Floats
    bin_m: float

    def at(self, points: Floats) -> Floats:
        """Density `(n,)` at points `(n, 2)`, bilinear between the bins; 0 outside."""
        place = ((points - self.origin) / self.bin_m).astype(np.float32)
        grid = self.values.astype(np.float32)
        columns, rows = place[:, 0], place[:, 1]
        outside = (place < 0).any(axis=1) | (columns > grid.shape[1] - 1) | (rows > grid.shape[0] - 1)
        col = np.clip(columns.astype(np.int64), 0, max(grid.shape[1] - 2, 0))
        row = np.clip(rows.astype(np.int64), 0, max(grid.shape[0] - 2, 0))
        u, v = columns - col, rows - row
        low = grid[row, col] * (1 - u) + grid[row, col + 1] * u
        high = grid[row + 1, col] * (1 - u) + grid[row + 1, col + 1] * u
        return np.where(outside, 0.0, low * (1 - v) + high * v).astype(np.float64)


def kernel_density(points: Floats, weights: Floats, bandwidth_m: float) -> Density:
    """The density of weighted points `(n, 2)`, `(n,)`; weights are normalised. Raises ValueError without points."""
    if not len(points):
        raise ValueError("no points: no density")
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN_BANDWIDTHS * bandwidth_m
    extent = high - low + 2.0 * margin
    bin_m = max(bandwidth_m / BINS_PER_BANDWIDTH, float(np.sqrt(extent.prod() / MOST_BINS)))
    cols, rows = (int(v) + 2 for v in np.ceil(extent / bin_m))
    origin = low - margin
    place = (points - origin) / bin_m
    corner = place.astype(np.int64)
    part = place - corner
    histogram = np.zeros(rows * cols)
    for dr in (0, 1):  # each point spreads over the four bins around it
        for dc in (0, 1):
            share = np.abs(1 - dc - part[:, 0]) * np.abs(1 - dr - part[:, 1])
            index = (corner[:, 1] + dr) * cols + corner[:, 0] + dc
            histogram += np.bincount(index, weights * share, rows * cols)
    grid = histogram.reshape(rows, cols) / (weights.sum() * bin_m**2)
    sigma = np.sqrt(
        max((bandwidth_m / bin_m) ** 2 - 1.0 / 6.0, 0.01)
    )  # the spreading has widened them already
    smooth = cv2.GaussianBlur(grid, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return Density(np.asarray(smooth), origin, bin_m)
