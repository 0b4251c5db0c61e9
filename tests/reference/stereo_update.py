"""Messages between rays and the update of the cells, as formulas over whole arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.stereo.chain import RayEvidence
from gridslam.kernels.stereo.stereo_update import CellEvidence, UpdateRule

Floats = NDArray[np.float64]


def couple_neighbouring_rays(
    evidence: RayEvidence, bearings: Floats, ranges: Floats, correlation: float, strength: float
) -> tuple[Floats, Floats]:
    """P(o, o' | E) and P(o, o' | not E) with the messages of both neighbours."""
    r = correlation ** (np.diff(bearings)[:, None] * ranges)
    same, other = 0.5 * (1.0 + r), 0.5 * (1.0 - r)
    occupied, empty = evidence.occupied, evidence.empty
    if_occupied, if_empty = occupied.copy(), empty.copy()
    for to, source in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
        if_occupied[to] *= (same * occupied[source] + other * empty[source]) ** strength
        if_empty[to] *= (other * occupied[source] + same * empty[source]) ** strength
    return if_occupied, if_empty


def updated(
    log_odds: Floats, reached: Floats, evidence: CellEvidence, rule: UpdateRule
) -> tuple[Floats, Floats]:
    """Log-odds and probability of being reached `(rows, cols)` after a frame."""
    prior, limit = rule.prior_log_odds, rule.max_log_odds
    change = rule.weight * np.log(evidence.occupied / evidence.empty)
    if rule.behind_once:
        p = np.clip(evidence.expected, rule.min_probability, 1.0 - rule.min_probability)
        missing = np.log(p / (1.0 - p)) - prior - log_odds
        once = np.clip(missing, 0.0, np.maximum(change, 0.0))
        change = np.where(change > 0.0, once + evidence.reached_surface * (change - once), change)
    has_evidence = (evidence.occupied != evidence.empty) | (evidence.reached != 0.0)
    changed = np.clip(log_odds + change, -limit - prior, limit - prior)
    return np.where(has_evidence, changed, log_odds), np.maximum(reached, evidence.reached)
