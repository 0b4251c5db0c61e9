"""Normal equations of places laid into a hand-drawn map, each with a rotation and two scales of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

Floats = NDArray[np.float64]


class PlacePoints(NamedTuple):
    """Points `(m, 2)` relative to their places (m, map frame); those of place k are the rows `starts[k]` to `starts[k + 1]`."""

    offsets: Floats
    starts: NDArray[np.int64]


class NormalEquations(NamedTuple):
    """Of every place: the matrix `(p, 5, 5)`, the gradient `(p, 5)`, and the truncated squares `(p,)` of its points."""

    matrix: Floats
    gradient: Floats
    cost: Floats


def normal_equations(
    fields: NDArray[np.float32], cell: float, points: PlacePoints, states: Floats, sigma_m: float
) -> NormalEquations:
    """Normal equations of the distances of all points (m), robust with the scale `sigma_m` (Geman-McClure).

    `fields` `(rows, cols, 3)` are the distance in drawing units and its slopes along x and y per cell; they are interpolated and
    go on outside. `states` `(p, 5)` are x, y (drawing units), yaw, and the logarithms of the scales along the drawing's axes.
    """
    p = len(states)
    out = NormalEquations(np.zeros((p, 5, 5)), np.zeros((p, 5)), np.zeros(p))
    _normal_equations(fields, cell, *points, states, sigma_m, *out)
    return out


@compiled
def _normal_equations(
    fields: NDArray[np.float32],
    cell: float,
    offsets: Floats,
    starts: NDArray[np.int64],
    states: Floats,
    sigma_m: float,
    matrix: Floats,
    gradient: Floats,
    cost: Floats,
) -> None:
    """Fill in the results of `normal_equations`."""
    rows, cols = fields.shape[0], fields.shape[1]
    sample = np.empty(3)
    row = np.empty(5)
    for k in range(len(states)):
        cos, sin = np.cos(states[k, 2]), np.sin(states[k, 2])
        sx, sy = np.exp(states[k, 3]), np.exp(states[k, 4])
        scale = np.sqrt(sx * sy)
        for i in range(starts[k], starts[k + 1]):
            x, y = offsets[i, 0], offsets[i, 1]
            dx, dy = sx * (cos * x - sin * y), sy * (sin * x + cos * y)
            at_x = min(max((states[k, 0] + dx) / cell - 0.5, 0.0), cols - 1.001)
            at_y = min(max((states[k, 1] + dy) / cell - 0.5, 0.0), rows - 1.001)
            c, r = int(at_x), int(at_y)
            fx, fy = at_x - c, at_y - r
            for j in range(3):
                low = fields[r, c, j] * (1.0 - fx) + fields[r, c + 1, j] * fx
                high = fields[r + 1, c, j] * (1.0 - fx) + fields[r + 1, c + 1, j] * fx
                sample[j] = low * (1.0 - fy) + high * fy
            residual = sample[0] / scale
            slope_x, slope_y = sample[1] / (cell * scale), sample[2] / (cell * scale)
            row[0], row[1] = slope_x, slope_y
            row[2] = slope_x * sx * (-sin * x - cos * y) + slope_y * sy * (cos * x - sin * y)
            row[3], row[4] = slope_x * dx, slope_y * dy
            ratio = sigma_m * sigma_m / (sigma_m * sigma_m + residual * residual)
            weight = ratio * ratio / (sigma_m * sigma_m)
            cost[k] += 1.0 - ratio
            for a in range(5):
                gradient[k, a] += weight * row[a] * residual
                for b in range(a + 1):
                    matrix[k, a, b] += weight * row[a] * row[b]
        for a in range(5):
            for b in range(a):
                matrix[k, b, a] = matrix[k, a, b]
