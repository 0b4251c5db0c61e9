"""Gaussian kernel density in the plane, as the equation reads."""

from __future__ import annotations

import math
from collections.abc import Sequence


def density_at(
    place: Sequence[float], points: Sequence[Sequence[float]], weights: Sequence[float], bandwidth_m: float
) -> float:
    """P(x) = 1 / (N h^2) sum K((x - x_i) / h), with weights instead of 1 / N, per square metre."""
    total = 0.0
    for point, weight in zip(points, weights, strict=True):
        u = math.dist(place, point) / bandwidth_m
        total += weight * math.exp(-0.5 * u * u) / (2.0 * math.pi)
    return total / (sum(weights) * bandwidth_m**2)
