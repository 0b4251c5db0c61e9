"""The correlation of neighbouring cells: as set, or as the map shows it while it grows (stereo-bayes 2.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.stereo_bayes.config import CorrelationConfig

Floats = NDArray[np.float64]

_EVERY = 5  # frames between two looks at the map
_FREE_BELOW, _OCCUPIED_FROM = 0.1, 0.9
_LEAST_PAIRS = 500
_MEMORY = 0.8
_LEAST, _MOST = 0.5, 0.998


class CorrelationEstimate:
    """r0 at `distance_m`; r(distance) = r0^(distance / distance_m) (eq. 8)."""

    def __init__(self, config: CorrelationConfig) -> None:
        self._distance_m = config.distance_m
        self.r0 = config.r0
        self._frames = 0

    def per_cell(self, resolution_m: float) -> float:
        """The correlation of cells one cell apart."""
        return float(self.r0 ** (resolution_m / self._distance_m))

    def learn(self, probability: Floats, resolution_m: float) -> None:
        """Take in the map `(rows, cols)`: the correlation of neighbours that are both all but certain, every few frames."""
        self._frames += 1
        if self._frames % _EVERY:
            return
        measured = neighbour_correlation(probability)
        if measured is None:
            return
        r0 = float(np.clip(measured, _LEAST, _MOST) ** (self._distance_m / resolution_m))
        self.r0 = _MEMORY * self.r0 + (1.0 - _MEMORY) * r0


def neighbour_correlation(probability: Floats) -> float | None:
    """Correlation of the states of horizontal and vertical neighbours that are both certain; None where they are few or alike."""
    occupied = probability > _OCCUPIED_FROM
    certain = occupied | (probability < _FREE_BELOW)
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
    if pairs < _LEAST_PAIRS:
        return None
    p, p_next = first / pairs, second / pairs
    scale = p * (1.0 - p) * p_next * (1.0 - p_next)
    if scale <= 0.0:
        return None
    return float((both / pairs - p * p_next) / np.sqrt(scale))
