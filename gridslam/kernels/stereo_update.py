"""What neighbouring rays tell each other, and what a frame does to the cells of the map (stereo-bayes)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

Floats = NDArray[np.float64]

_MOST_CORRELATION = 0.999


def told_across(
    occupied: Floats, empty: Floats, bearings: Floats, ranges: Floats, correlation: float, share: float
) -> tuple[Floats, Floats]:
    """P(o, o' | E) and P(o, o' | not E) `(m, n)`: every cell also hears what the neighbouring rays say.

    `occupied` and `empty` `(m, n)` are P(o | E) and P(o | not E) of rays at `bearings` `(m,)`; `ranges` `(n,)` in cells. Cells
    at the same range on neighbouring rays correlate by `correlation` to the power of their distance in cells. One round of
    messages between pairs: P(o' | E) = P(E'|E) P(o'|E') + P(not E'|E) P(o'|not E'), with prior 1/2, to the power of `share`.
    """
    decay = np.log(max(correlation, 1e-300))
    r = np.exp(decay * np.abs(np.diff(bearings))[:, None] * ranges)  # numpy's is faster than the compiler's
    told: tuple[Floats, Floats] = _told(occupied, empty, np.minimum(r, _MOST_CORRELATION), share)
    return told


@compiled
def _told(occupied: Floats, empty: Floats, r: Floats, share: float) -> tuple[Floats, Floats]:
    """`told_across` with the correlations `r` `(m - 1, n)` of each ray with the next one."""
    m, n = occupied.shape
    if_occupied, if_empty = np.ones((m, n)), np.ones((m, n))
    for i in range(m - 1):
        for k in range(n):
            half = 0.5 * r[i, k]
            mean, off = 0.5 * (occupied[i, k] + empty[i, k]), half * (occupied[i, k] - empty[i, k])
            if_occupied[i + 1, k] *= mean + off
            if_empty[i + 1, k] *= mean - off
            mean, off = (
                0.5 * (occupied[i + 1, k] + empty[i + 1, k]),
                half * (occupied[i + 1, k] - empty[i + 1, k]),
            )
            if_occupied[i, k] *= mean + off
            if_empty[i, k] *= mean - off
    for i in range(m):
        for k in range(n):
            if share == 0.5:  # much faster than a power
                if_occupied[i, k], if_empty[i, k] = np.sqrt(if_occupied[i, k]), np.sqrt(if_empty[i, k])
            elif share != 1.0:
                if_occupied[i, k], if_empty[i, k] = if_occupied[i, k] ** share, if_empty[i, k] ** share
            if_occupied[i, k] *= occupied[i, k]
            if_empty[i, k] *= empty[i, k]
    return if_occupied, if_empty


@compiled
def tell_cells(
    values: Floats,
    told: Floats,
    weight: float,
    prior: float,
    limit: float,
    least: float,
    behind_once: bool,
) -> None:
    """Change the cells `values` `(rows, cols, 2)` (log odds less the `prior`'s, seen) by what a frame says of them.

    `told` `(5, rows, cols)`: P(o | E), P(o | not E), P(a ray came there | o), the same a surface's thickness nearer, and
    P(E | o) if nothing was known behind obstacles. What the chain expects behind a surface follows from the surface: seeing
    that again and again makes it no surer. So with `behind_once`, what raises a cell beyond the expectation of this frame
    alone counts as far as a ray has come there. Log odds stay within `limit`, probabilities within `least`.
    """
    _, rows, cols = told.shape
    for row in range(rows):
        for col in range(cols):
            if_occupied, if_empty, reached = told[0, row, col], told[1, row, col], told[2, row, col]
            if if_occupied == if_empty and reached == 0.0:
                continue
            change = weight * np.log(if_occupied / if_empty)
            if behind_once and change > 0.0:
                p = min(max(told[4, row, col], least), 1.0 - least)
                at_once = min(max(np.log(p / (1.0 - p)) - prior - values[row, col, 0], 0.0), change)
                change = at_once + told[3, row, col] * (change - at_once)
            values[row, col, 0] = min(max(values[row, col, 0] + change, -limit - prior), limit - prior)
            values[row, col, 1] = max(values[row, col, 1], reached)
