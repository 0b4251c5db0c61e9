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
    """`fit`: share of the beams that the map explains, running mean; `distance_m`: mean distance of end points to walls.

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
        distance = float("nan")
        if len(beams.points):
            distance = float(self._sight.field.under(beams.points, belief.mean).mean())
            present = self._fit_of(beams, belief.mean)
            past = present if self._fit is None else self._fit
            self._fit = config.memory * past + (1.0 - config.memory) * present
        fit = 0.0 if self._fit is None else self._fit
        confidence = confidence_of(fit, belief, config)
        return Assessment(fit, distance, confidence, _status(confidence, config))

    def _fit_of(self, beams: Beams, pose: Floats) -> float:
        """Share of the returned beams that the map explains from a pose; what is less than a contradiction counts in part.

        A beam that ends at a wall behind another one may be moved furniture, and one that ends in the open may be a person.
        """
        points = beams.points
        segments = Segments(np.broadcast_to(beams.mounting[:2], points.shape), points)
        seen = float(self._sight.sums(self._explained, segments, pose[None])[0])
        ended = float(self._sight.field.sums(self._explained, points, pose[None])[0])
        in_the_open = self._count_in_the_open(beams, pose)
        behind, open_ = self._config.behind_share, self._config.open_share
        return (seen + behind * (ended - seen) + open_ * in_the_open) / len(points)

    def _count_in_the_open(self, beams: Beams, pose: Floats) -> int:
        """Beams that end far from all walls, and well before the wall that they point at."""
        returned = beams.returned
        far = self._sight.field.under(beams.points, pose) >= self._config.tolerance_m
        expected = self._sight.caster.ranges(
            pose[None], beams.bearings[returned], beams.mounting, beams.reach_m
        )[0]
        before = beams.ranges[returned] < expected - self._config.sight_tolerance_m
        return int((far & before).sum())


def confidence_of(fit: float, belief: Belief, config: ConfidenceConfig) -> float:
    """Fit, mass and spread in one number from 0 to 1."""
    by_fit = np.clip((fit - config.lost_fit) / max(config.good_fit - config.lost_fit, 1e-9), 0.0, 1.0)
    by_spread = 1.0 / (1.0 + (belief.spread_m / config.spread_m) ** 2)
    return float(by_fit * min(belief.mass, 1.0) * by_spread)


def _status(confidence: float, config: ConfidenceConfig) -> str:
    if confidence >= config.localized:
        return "localized"
    return "lost" if confidence < config.lost else "uncertain"
