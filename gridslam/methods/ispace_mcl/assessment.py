"""Am I lost? How well the scan fits where the filter believes to be, and how spread the particles are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.particles import Belief
from gridslam.methods.ispace_mcl.config import ConfidenceConfig
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.sight import Sight

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
        self._fit: float | None = None

    def restart(self) -> None:
        """Forget the past, after the filter has moved elsewhere."""
        self._fit = None

    def assess(self, belief: Belief, beams: Beams) -> Assessment:
        """The present answer, from the main cluster and all beams of a scan."""
        config = self._config
        distance = float("nan")
        if len(beams.points):
            distances = self._sight.field.under(beams.points, belief.mean)
            distance = float(distances.mean())
            present = self._fit_of(beams, belief.mean, distances)
            past = present if self._fit is None else self._fit
            self._fit = config.memory * past + (1.0 - config.memory) * present
        fit = 0.0 if self._fit is None else self._fit
        confidence = confidence_of(fit, belief, config)
        return Assessment(fit, distance, confidence, _status(confidence, config))

    def _fit_of(self, beams: Beams, pose: Floats, distances: Floats) -> float:
        """Share of the returned beams that the map explains from a pose; what is less than a contradiction counts in part.

        A beam that ends at a wall behind another one may be moved furniture, and one that ends in the open may be a person.
        `distances` `(m,)` are those of the end points to walls.
        """
        config, sight = self._config, self._sight
        bearings, ranges = beams.bearings[beams.returned], beams.ranges[beams.returned]
        aside = np.arctan2(sight.slack_m, ranges)
        around = np.concatenate([bearings, bearings + aside, bearings - aside])
        expected = sight.caster.ranges(pose[None], around, beams.extrinsics, beams.reach_m)[0].reshape(3, -1)
        at_wall = distances < config.tolerance_m
        blocked = (expected < ranges - sight.tolerance_m).all(axis=0)
        in_the_open = ~at_wall & (ranges < expected[0] - sight.tolerance_m)
        worth = np.where(
            at_wall, np.where(blocked, config.behind_share, 1.0), config.open_share * in_the_open
        )
        return float(worth.mean())


def confidence_of(fit: float, belief: Belief, config: ConfidenceConfig) -> float:
    """Fit, mass and spread in one number from 0 to 1."""
    by_fit = np.clip((fit - config.lost_fit) / max(config.good_fit - config.lost_fit, 1e-9), 0.0, 1.0)
    by_spread = 1.0 / (1.0 + (belief.spread_m / config.spread_m) ** 2)
    return float(by_fit * min(belief.mass, 1.0) * by_spread)


def _status(confidence: float, config: ConfidenceConfig) -> str:
    if confidence >= config.localized:
        return "localized"
    return "lost" if confidence < config.lost else "uncertain"
