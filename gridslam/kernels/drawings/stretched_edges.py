"""Normal equations of the edges between places laid into a hand-drawn map: each expects its neighbour where the map has it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

Floats = NDArray[np.float64]


class PlaceEdges(NamedTuple):
    """Edges from places `ends[:, 0]` to places `ends[:, 1]` `(e, 2)`, the offsets `(e, 2)` between them (m, map frame), and the
    standard deviations `(e,)` of what a drawing changes along each: of the offset (m), the rotation (rad) and the log scales."""

    ends: NDArray[np.int64]
    offsets: Floats
    offset_std_m: Floats
    rotation_std: Floats
    scale_std: Floats


def edge_residuals(edges: PlaceEdges, states: Floats) -> Floats:
    """Residuals `(e, 5)` of all edges in standard deviations: offset, rotation and log scales.

    `states` `(p, 5)` are x, y (drawing units), yaw, and the logarithms of the scales along the drawing's axes.
    """
    residuals = np.empty((len(edges.ends), 5))
    _edge_residuals(*edges, states, residuals)
    return residuals


def add_edge_equations(
    edges: PlaceEdges, states: Floats, jump: float, weight: float, gradient: Floats
) -> Floats:
    """Blocks `(e, 2, 2, 5, 5)` of the normal equations of all edges, by the edge's two ends; `gradient` `(p, 5)` is added to.

    Robust: the offset, the rotation and each log scale weigh ever less beyond `jump` standard deviations.
    """
    blocks = np.zeros((len(edges.ends), 2, 2, 5, 5))
    _add_edge_equations(*edges, states, edge_residuals(edges, states), jump, weight, gradient, blocks)
    return blocks


@compiled
def _edge_residuals(
    ends: NDArray[np.int64],
    offsets: Floats,
    offset_std_m: Floats,
    rotation_std: Floats,
    scale_std: Floats,
    states: Floats,
    residuals: Floats,
) -> None:
    """Fill in the results of `edge_residuals`."""
    for i in range(len(ends)):
        a, b = states[ends[i, 0]], states[ends[i, 1]]
        scale = np.exp(0.25 * (a[3] + a[4] + b[3] + b[4]))
        std = scale * offset_std_m[i]
        cos, sin = np.cos(a[2]), np.sin(a[2])
        x, y = offsets[i, 0], offsets[i, 1]
        residuals[i, 0] = (b[0] - a[0] - np.exp(a[3]) * (cos * x - sin * y)) / std
        residuals[i, 1] = (b[1] - a[1] - np.exp(a[4]) * (sin * x + cos * y)) / std
        rotation = b[2] - a[2]
        rotation -= 2.0 * np.pi * np.round(rotation / (2.0 * np.pi))
        residuals[i, 2] = rotation / rotation_std[i]
        residuals[i, 3] = (b[3] - a[3]) / scale_std[i]
        residuals[i, 4] = (b[4] - a[4]) / scale_std[i]


@compiled
def _add_edge_equations(
    ends: NDArray[np.int64],
    offsets: Floats,
    offset_std_m: Floats,
    rotation_std: Floats,
    scale_std: Floats,
    states: Floats,
    residuals: Floats,
    jump: float,
    edge_weight: float,
    gradient: Floats,
    blocks: Floats,
) -> None:
    """Fill in the results of `add_edge_equations`."""
    slopes = np.zeros((2, 5, 5))  # by end of the edge, residual and state
    weights = np.empty(5)
    for i in range(len(ends)):
        a, b = states[ends[i, 0]], states[ends[i, 1]]
        std = np.exp(0.25 * (a[3] + a[4] + b[3] + b[4])) * offset_std_m[i]
        cos, sin = np.cos(a[2]), np.sin(a[2])
        x, y = offsets[i, 0], offsets[i, 1]
        sx, sy = np.exp(a[3]) / std, np.exp(a[4]) / std
        for k in range(2):
            slopes[0, k, k], slopes[1, k, k] = -1.0 / std, 1.0 / std
        slopes[0, 2, 2], slopes[1, 2, 2] = -1.0 / rotation_std[i], 1.0 / rotation_std[i]
        for k in range(3, 5):
            slopes[0, k, k], slopes[1, k, k] = -1.0 / scale_std[i], 1.0 / scale_std[i]
        slopes[0, 0, 2], slopes[0, 1, 2] = sx * (sin * x + cos * y), -sy * (cos * x - sin * y)
        slopes[0, 0, 3], slopes[0, 1, 4] = -sx * (cos * x - sin * y), -sy * (sin * x + cos * y)
        gap = residuals[i, 0] ** 2 + residuals[i, 1] ** 2
        for k in range(5):
            squared = gap if k < 2 else residuals[i, k] ** 2
            weights[k] = edge_weight / (1.0 + squared / (jump * jump))
        for left in range(2):
            for s in range(5):
                for k in range(5):
                    weighted = weights[k] * slopes[left, k, s]
                    if weighted == 0.0:
                        continue
                    gradient[ends[i, left], s] += weighted * residuals[i, k]
                    for right in range(2):
                        for t in range(5):
                            blocks[i, left, right, s, t] += weighted * slopes[right, k, t]
