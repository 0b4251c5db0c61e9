"""Am I lost? How well the scan fits where the filter believes to be, and how spread the particles are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.particles import Belief
from gridslam.methods.ispace_mcl.config import ConfidenceConfig
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.sight import Segments, Sight

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Assessment:
    """`fit`: share of the beams that the map explains, running mean over scans; `distance_m`: mean distance of end points to walls.

    `confidence` in 0..1 is the fit between its bounds, times the mass of the main cluster, times what its spread leaves.
    """

    fit: float
    distance_m: float
    confidence: float
    status: str  # localized, uncertain, lost


class Watch:
    """Follows the fit over the scans."""

    def __init__(self, config: ConfidenceConfig, sight: Sight) -> None:
        self._config = config
        self._sight = sight
        self._explained = (sight.field.distances_m < config.tolerance_m).astype(np.float32)
        self._fit: float | None = None

    def restart(self) -> None:
        """Forget the past, after the filter has moved elsewhere."""
        self._fit = None

    def assess(self, belief: Belief, beams: Beams) -> Assessment:
        """The present answer, from the main cluster and all beams of a scan."""
        config = self._config
        points = beams.points
        if len(points):
            distance = float(self._sight.field.under(points, belief.mean).mean())
            segments = Segments(np.broadcast_to(beams.mounting[:2], points.shape), points)
            seen = float(self._sight.sums(self._explained, segments, belief.mean[None])[0])
            ended = float(self._sight.field.sums(self._explained, points, belief.mean[None])[0])
            present = (
                0.5 * (seen + ended) / len(points)
            )  # moved furniture blocks the way of many beams: half a fault
            self._fit = (
                present if self._fit is None else config.memory * self._fit + (1.0 - config.memory) * present
            )
        else:
            distance = float("nan")
        fit = 0.0 if self._fit is None else self._fit
        confidence = confidence_of(fit, belief, config)
        status = (
            "localized"
            if confidence >= config.localized
            else "lost"
            if confidence < config.lost
            else "uncertain"
        )
        return Assessment(fit, distance, confidence, status)


def confidence_of(fit: float, belief: Belief, config: ConfidenceConfig) -> float:
    """Fit, mass and spread in one number from 0 to 1."""
    by_fit = np.clip((fit - config.lost_fit) / max(config.good_fit - config.lost_fit, 1e-9), 0.0, 1.0)
    by_spread = 1.0 / (1.0 + (belief.spread_m / config.spread_m) ** 2)
    return float(by_fit * min(belief.mass, 1.0) * by_spread)
