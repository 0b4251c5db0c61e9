"""The normal equations of places in a drawing, point by point, with Jacobians by differences."""

from __future__ import annotations

import numpy as np

STEP = 1e-6


def normal_equations(field, cell, offsets, state, sigma_m):
    """Matrix `(5, 5)`, gradient `(5,)` and cost of one place, for a field `(rows, cols)` that is a plane."""
    matrix, gradient, cost = np.zeros((5, 5)), np.zeros(5), 0.0
    for offset in offsets:
        scale = np.exp(0.5 * (state[3] + state[4]))
        residual = distance(field, cell, offset, state) / scale
        # The scale by which distances become metres is held: a small copy of a view lies no nearer to a wall.
        row = np.array(
            [
                (distance(field, cell, offset, state + step) - distance(field, cell, offset, state - step))
                / (2.0 * STEP * scale)
                for step in STEP * np.eye(5)
            ]
        )
        ratio = sigma_m**2 / (sigma_m**2 + residual**2)
        matrix += ratio**2 / sigma_m**2 * np.outer(row, row)
        gradient += ratio**2 / sigma_m**2 * row * residual
        cost += residual**2 / (sigma_m**2 + residual**2)
    return matrix, gradient, cost


def distance(field, cell, offset, state):
    """The field, interpolated, where the state puts a point."""
    cos, sin = np.cos(state[2]), np.sin(state[2])
    x = (state[0] + np.exp(state[3]) * (cos * offset[0] - sin * offset[1])) / cell - 0.5
    y = (state[1] + np.exp(state[4]) * (sin * offset[0] + cos * offset[1])) / cell - 0.5
    col, row = int(np.floor(x)), int(np.floor(y))
    across, up = x - col, y - row
    below = (1 - across) * field[row, col] + across * field[row, col + 1]
    above = (1 - across) * field[row + 1, col] + across * field[row + 1, col + 1]
    return (1 - up) * below + up * above
