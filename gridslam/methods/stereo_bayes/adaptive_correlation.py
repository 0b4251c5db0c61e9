"""The correlation of neighbouring cells: as configured, or estimated from the map while it grows (stereo-bayes 2.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REFERENCE_DISTANCE_M = 0.05  # r0 is the correlation of cells at this distance
UPDATE_EVERY = 5  # frames
MAX_FREE, MIN_OCCUPIED = 0.1, 0.9  # probabilities of cells whose state is certain
MIN_PAIRS = 500  # smallest number of pairs of certain neighbours
SMOOTHING = 0.8  # weight of the estimate so far
MIN_MEASURED, MAX_MEASURED = 0.5, 0.998  # limits of the measured correlation of neighbours


class CorrelationEstimate:
    """r0 at the reference distance; r(distance) = r0^(distance / reference distance) (eq. 8)."""

    def __init__(self, r0: float) -> None:
        self.r0 = r0
        self._frames = 0

    def per_cell(self, resolution_m: float) -> float:
        """The correlation of cells one cell apart."""
        return float(self.r0 ** (resolution_m / REFERENCE_DISTANCE_M))

    def update(self, probability: Floats, resolution_m: float) -> None:
        """Every few frames, update r0 by the correlation of certain neighbours in the map `probability` `(rows, cols)`."""
        self._frames += 1
        if self._frames % UPDATE_EVERY:
            return
        measured = neighbour_correlation(probability)
        if measured is None:
            return
        r0 = float(np.clip(measured, MIN_MEASURED, MAX_MEASURED) ** (REFERENCE_DISTANCE_M / resolution_m))
        self.r0 = SMOOTHING * self.r0 + (1.0 - SMOOTHING) * r0


def neighbour_correlation(probability: Floats) -> float | None:
    """Correlation of the states of neighbouring cells, over pairs that are both certain in the `probability` `(rows, cols)`.

    None if there are too few pairs, or if all these cells have the same state.
    """
    occupied = probability > MIN_OCCUPIED
    certain = occupied | (probability < MAX_FREE)
    both, first, second = 0, 0, 0
    pairs = 0
    for a, b in (
        ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
    ):
        known = certain[a] & certain[b]
        pairs += int(known.sum())
        both += int((occupied[a] & occupied[b] & known).sum())
        first += int((occupied[a] & known).sum())
        second += int((occupied[b] & known).sum())
    if pairs < MIN_PAIRS:
        return None
    p, p_next = first / pairs, second / pairs
    scale = p * (1.0 - p) * p_next * (1.0 - p_next)
    if scale <= 0.0:
        return None
    return float((both / pairs - p * p_next) / np.sqrt(scale))
