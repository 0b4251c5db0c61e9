"""Messages between rays and the cells' update, as formulas over whole arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def told_across(
    occupied: Floats, empty: Floats, bearings: Floats, ranges: Floats, correlation: float, share: float
) -> tuple[Floats, Floats]:
    """P(o, o' | E) and P(o, o' | not E) with both neighbours' messages."""
    r = correlation ** (np.diff(bearings)[:, None] * ranges)
    same, other = 0.5 * (1.0 + r), 0.5 * (1.0 - r)
    if_occupied, if_empty = occupied.copy(), empty.copy()
    for to, source in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
        if_occupied[to] *= (same * occupied[source] + other * empty[source]) ** share
        if_empty[to] *= (other * occupied[source] + same * empty[source]) ** share
    return if_occupied, if_empty


def told_cells(
    values: Floats, told: Floats, weight: float, prior: float, limit: float, least: float, behind_once: bool
) -> Floats:
    """The cells `(rows, cols, 2)` after a frame: log odds and whether they were seen."""
    change = weight * np.log(told[0] / told[1])
    if behind_once:
        p = np.clip(told[4], least, 1.0 - least)
        room = np.log(p / (1.0 - p)) - prior - values[..., 0]
        at_once = np.clip(room, 0.0, np.maximum(change, 0.0))
        change = np.where(change > 0.0, at_once + told[3] * (change - at_once), change)
    is_met = (told[0] != told[1]) | (told[2] != 0.0)
    changed = np.clip(values[..., 0] + change, -limit - prior, limit - prior)
    return np.stack([np.where(is_met, changed, values[..., 0]), np.maximum(values[..., 1], told[2])], axis=-1)
