"""People who walk along a path and back, with a speed that changes at random."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.simulation.shapes import Person

STEP_S = 0.1
SPEED_MEMORY_S = 3.0
STRIDE_M = 0.7
LEG_OFFSET_M = 0.12
FURTHEST_AHEAD = 1000  # steps that are drawn at once


class Walker:
    """Where one person is at any time; the way is drawn from its own random stream as far as it is asked for."""

    def __init__(self, person: Person, rng: np.random.Generator) -> None:
        self.person = person
        self._rng = rng
        corners = np.asarray(person.path, dtype=np.float64)
        self._corners = np.concatenate([corners, corners[-2::-1]])
        lengths = np.hypot(*np.diff(self._corners, axis=0).T)
        self._ends = np.concatenate([[0.0], np.cumsum(lengths)])
        self._way: list[float] = [0.0]
        self._deviation = 0.0

    def way_m(self, time_s: float) -> float:
        """How far the person has walked."""
        steps = max(time_s - self.person.starts_at_s, 0.0) / STEP_S
        whole = int(steps)
        while len(self._way) < whole + 2:
            self._walk_on()
        return self._way[whole] + (steps - whole) * (self._way[whole + 1] - self._way[whole])

    def pose(self, time_s: float) -> tuple[float, float, float]:
        """x, y, heading."""
        way = self.way_m(time_s) % self._ends[-1] if self._ends[-1] else 0.0
        i = min(int(np.searchsorted(self._ends, way, side="right")) - 1, len(self._ends) - 2)
        (x0, y0), (x1, y1) = self._corners[i], self._corners[i + 1]
        length = self._ends[i + 1] - self._ends[i]
        share = (way - self._ends[i]) / length if length else 0.0
        heading = math.atan2(y1 - y0, x1 - x0)
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0), heading

    def legs(self, time_s: float) -> NDArray[np.float64]:
        """Two circles `(2, 3)`, one before the other as the person strides."""
        x, y, heading = self.pose(time_s)
        swing = 0.5 * STRIDE_M * math.sin(2.0 * math.pi * self.way_m(time_s) / (2.0 * STRIDE_M)) * 0.6
        cos, sin = math.cos(heading), math.sin(heading)
        radius = self.person.leg_radius_m
        sides = ((swing, LEG_OFFSET_M), (-swing, -LEG_OFFSET_M))
        return np.array([(x + f * cos - s * sin, y + f * sin + s * cos, radius) for f, s in sides])

    def _walk_on(self) -> None:
        """Speeds form a first-order process about the mean; nobody walks backwards."""
        keep = math.exp(-STEP_S / SPEED_MEMORY_S)
        fresh = self.person.speed_deviation_mps * math.sqrt(1.0 - keep * keep)
        for draw in self._rng.standard_normal(FURTHEST_AHEAD).tolist():
            self._deviation = keep * self._deviation + fresh * draw
            speed = max(self.person.speed_mps + self._deviation, 0.0)
            self._way.append(self._way[-1] + speed * STEP_S)
