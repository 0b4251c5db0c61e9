"""Options of a path planner: the robot and its obstacles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.planning.footprint import disc
from gridslam.planning.obstacles import OCCUPIED_FROM, ROBOT_RADIUS_M
from gridslam.planning.travel_time import SpeedLimits

Floats = NDArray[np.float64]

MIN_MARGIN_M = 1e-4  # below, rounding decides whether the robot touches a wall


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """The robot's footprint, the motions it can make, and which cells are obstacles.

    discs: Discs `(n, 3)` (x, y, radius; m, robot frame) that cover the footprint.
    min_radius_m: Smallest turning radius; 0 only for a robot that turns on the spot anywhere.
    turn_on_spot: Whether the robot may turn on the spot at the start and the goal.
    reverse: Whether it may drive backwards.
    reverse_cost_s: Cost of a change of direction in the search.
    margin_m: Clearance that the discs keep from obstacles.
    occupied_from: Cells with P above this are obstacles.
    unknown_blocks: Whether unknown cells are obstacles.
    limits: Speeds and accelerations.

    Raises ConfigError if a value is out of range.
    """

    discs: Floats = field(default_factory=lambda: disc(ROBOT_RADIUS_M))
    min_radius_m: float = 0.2
    turn_on_spot: bool = False
    reverse: bool = False
    reverse_cost_s: float = 2.0
    margin_m: float = 0.005
    occupied_from: float = OCCUPIED_FROM
    unknown_blocks: bool = True
    limits: SpeedLimits = field(default_factory=SpeedLimits)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.min_radius_m) and self.min_radius_m >= 0.0):
            raise ConfigError(f"smallest radius {self.min_radius_m:g}: expected metres, not negative")
        if not (np.isfinite(self.margin_m) and self.margin_m >= MIN_MARGIN_M):
            raise ConfigError(f"margin {self.margin_m:g}: expected at least 0.0001 m")
        if not 0.0 < self.occupied_from < 1.0:
            raise ConfigError(f"occupied from {self.occupied_from:g}: expected a probability between 0 and 1")
        if self.min_radius_m == 0.0 and not self.turn_on_spot:
            raise ConfigError("smallest radius 0: only a robot that may turn on the spot has none")
