"""Whether the mirror image of the scans fits the map better than the scans do: then the map is mirrored.

In a nearly symmetric place the robot is localized on a mirrored map too, a few decimetres off, with a little less agreement.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.ispace_mcl.weighing import RANDOM_WEIGHT
from gridslam.sensors.likelihood_field import log_likelihood_table
from gridslam.sensors.pose_search import PoseHypotheses, climb
from gridslam.sensors.visibility import BeamSegments, VisibilityField

Floats = NDArray[np.float64]

ENDPOINT_STD_M = 0.07  # narrow: the walls of a mirrored map are off by decimetres only
COMPARED = 40  # number of hypotheses of a search that are compared
MAX_CHECKS = 6  # each takes another search
MIN_CHECKS = 2
# Lead of the mirror image per beam; on right maps that are nearly their own mirror image it is 0 or less
MIN_LEAD = 0.015
# Lag of the mirror image over MIN_CHECKS windows from which the map is not mirrored, and no others are searched
CLEAR_LAG = 0.05
_STEPS = ((0.1, 0.02), (0.05, 0.01), (0.05, 0.01), (0.025, 0.005), (0.025, 0.005), (0.0125, 0.0025))  # m, rad


class MirrorCheck:
    """Compares windows of scans with their mirror images, each where it fits best on the whole map."""

    def __init__(self, search: Callable[[BeamSegments], PoseHypotheses], visibility: VisibilityField) -> None:
        self._search = search
        self._visibility = visibility
        self._table = log_likelihood_table(visibility.field, ENDPOINT_STD_M, RANDOM_WEIGHT)
        self._leads: list[float] = []

    @property
    def is_mirrored(self) -> bool:
        """Whether the map is mirrored, as far as the windows show it."""
        return len(self._leads) >= MIN_CHECKS and float(np.mean(self._leads)) > MIN_LEAD

    @property
    def _is_finished(self) -> bool:
        """Whether further windows would not change the result."""
        if len(self._leads) >= MAX_CHECKS:
            return True
        return len(self._leads) >= MIN_CHECKS and max(self._leads) < -CLEAR_LAG

    def add(self, beams: BeamSegments, poses: Floats) -> None:
        """Compare the beams of a window with their mirror image; `poses` `(n, 3)` are where the beams fit, best first."""
        if not self._is_finished:
            image = BeamSegments(beams.origins * [1.0, -1.0], beams.endpoints * [1.0, -1.0])
            lead = self._best(image, self._search(image).poses) - self._best(beams, poses)
            self._leads.append(lead)

    def _best(self, beams: BeamSegments, poses: Floats) -> float:
        """The largest mean log-likelihood of a beam near the poses."""

        def score(tried: Floats) -> Floats:
            return self._visibility.table_sums(self._table, beams, tried) / len(beams)

        poses = poses[:COMPARED]
        scores = score(poses)
        for step_m, step_rad in _STEPS:
            poses, scores = climb(score, poses, scores, step_m, step_rad)
        return float(scores.max())
