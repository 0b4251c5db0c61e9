"""Coupling of neighbouring rays, and the update of the map's cells by the evidence of a frame (stereo-bayes)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.stereo.chain import RayEvidence

Floats = NDArray[np.float64]

_MAX_CORRELATION = 0.999
_MIN_CORRELATION = 1e-300  # keeps the logarithm finite


class CellEvidence(NamedTuple):
    """The evidence of a frame for the cells of the map, all `(rows, cols)`.

    P(o | E), P(o | not E), P(a ray reached the cell | o), the same one surface thickness nearer to the camera, and P(E | o) if
    nothing were known behind obstacles.
    """

    occupied: Floats
    empty: Floats
    reached: Floats
    reached_surface: Floats
    expected: Floats


class UpdateRule(NamedTuple):
    """`weight` is the power of the likelihoods, `prior_log_odds` those of an unknown cell.

    Log-odds stay within `max_log_odds`, probabilities at least `min_probability` away from 0 and 1. `behind_once`: what is
    expected behind a surface counts once, not with every frame.
    """

    weight: float
    prior_log_odds: float
    max_log_odds: float
    min_probability: float
    behind_once: bool


def couple_neighbouring_rays(
    evidence: RayEvidence, bearings: Floats, ranges: Floats, correlation: float, strength: float
) -> RayEvidence:
    """Evidence in which P(o | E) and P(o | not E) of every cell include the messages of both neighbouring rays.

    `bearings` `(m,)` (rad) are those of the rays, `ranges` `(n,)` (cells) those of the cells. Cells at the same range on
    neighbouring rays correlate by `correlation` to the power of their distance in cells. One round of pairwise messages:
    P(o' | E) = P(E'|E) P(o'|E') + P(not E'|E) P(o'|not E') with prior 1/2, to the power of `strength` (0 to 1).
    """
    decay = np.log(max(correlation, _MIN_CORRELATION))
    # numpy's exp is faster than the compiler's
    r = np.exp(decay * np.abs(np.diff(bearings))[:, None] * ranges)
    r = np.minimum(r, _MAX_CORRELATION)
    occupied, empty = _pass_messages(evidence.occupied, evidence.empty, r, strength)
    return evidence._replace(occupied=occupied, empty=empty)


@compiled
def _pass_messages(occupied: Floats, empty: Floats, r: Floats, strength: float) -> tuple[Floats, Floats]:
    """P(o, o' | E) and P(o, o' | not E) `(m, n)`; `r` `(m - 1, n)` are the correlations of each ray with the next."""
    m, n = occupied.shape
    if_occupied, if_empty = np.ones((m, n)), np.ones((m, n))
    for i in range(m - 1):
        for k in range(n):
            half = 0.5 * r[i, k]
            mean, difference = 0.5 * (occupied[i, k] + empty[i, k]), half * (occupied[i, k] - empty[i, k])
            if_occupied[i + 1, k] *= mean + difference
            if_empty[i + 1, k] *= mean - difference
            mean, difference = (
                0.5 * (occupied[i + 1, k] + empty[i + 1, k]),
                half * (occupied[i + 1, k] - empty[i + 1, k]),
            )
            if_occupied[i, k] *= mean + difference
            if_empty[i, k] *= mean - difference
    for i in range(m):
        for k in range(n):
            if strength == 0.5:  # much faster than a power
                if_occupied[i, k], if_empty[i, k] = np.sqrt(if_occupied[i, k]), np.sqrt(if_empty[i, k])
            elif strength != 1.0:
                if_occupied[i, k] = if_occupied[i, k] ** strength
                if_empty[i, k] = if_empty[i, k] ** strength
            if_occupied[i, k] *= occupied[i, k]
            if_empty[i, k] *= empty[i, k]
    return if_occupied, if_empty


@compiled
def apply_update(log_odds: Floats, reached: Floats, evidence: CellEvidence, rule: UpdateRule) -> None:
    """Update the cells of the map in place: `log_odds` relative to the prior's, and `reached`, both `(rows, cols)`.

    `reached` keeps the largest probability with which any ray has reached the cell. What the chain expects behind a surface
    follows from the surface, so that seeing it again is no new evidence. With `behind_once` the part of a change that exceeds
    the expectation of this frame alone is weighted by the probability that a ray has reached the cell.
    """
    weight, prior, limit = rule.weight, rule.prior_log_odds, rule.max_log_odds
    rows, cols = evidence.occupied.shape
    for row in range(rows):
        for col in range(cols):
            if_occupied, if_empty = evidence.occupied[row, col], evidence.empty[row, col]
            if if_occupied == if_empty and evidence.reached[row, col] == 0.0:
                continue
            change = weight * np.log(if_occupied / if_empty)
            if rule.behind_once and change > 0.0:
                p = min(max(evidence.expected[row, col], rule.min_probability), 1.0 - rule.min_probability)
                once = min(max(np.log(p / (1.0 - p)) - prior - log_odds[row, col], 0.0), change)
                change = once + evidence.reached_surface[row, col] * (change - once)
            log_odds[row, col] = min(max(log_odds[row, col] + change, -limit - prior), limit - prior)
            reached[row, col] = max(reached[row, col], evidence.reached[row, col])
