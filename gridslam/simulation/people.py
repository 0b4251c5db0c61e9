"""People who walk along a path and back at a random speed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.simulation.shapes import Person

STEP_S = 0.1
SPEED_CORRELATION_S = 3.0
STRIDE_M = 0.7
LEG_OFFSET_M = 0.12
STEPS_AT_ONCE = 1000  # speeds are drawn in batches of this size


class Walker:
    """One person's position at any time. The speeds are drawn from a random stream of its own, as far ahead as needed."""

    def __init__(self, person: Person, rng: np.random.Generator) -> None:
        self.person = person
        self._rng = rng
        corners = np.asarray(person.path, dtype=np.float64)
        self._corners = np.concatenate([corners, corners[-2::-1]])
        lengths = np.hypot(*np.diff(self._corners, axis=0).T)
        self._ends = np.concatenate([[0.0], np.cumsum(lengths)])
        self._distances: list[float] = [0.0]
        self._deviation = 0.0

    def distance_m(self, time_s: float) -> float:
        """Distance (m) walked by a time."""
        steps = max(time_s - self.person.starts_at_s, 0.0) / STEP_S
        whole = int(steps)
        while len(self._distances) < whole + 2:
            self._extend()
        return self._distances[whole] + (steps - whole) * (
            self._distances[whole + 1] - self._distances[whole]
        )

    def pose(self, time_s: float) -> tuple[float, float, float]:
        """x, y (m) and heading (rad) at a time."""
        along = self.distance_m(time_s) % self._ends[-1] if self._ends[-1] else 0.0
        i = min(int(np.searchsorted(self._ends, along, side="right")) - 1, len(self._ends) - 2)
        (x0, y0), (x1, y1) = self._corners[i], self._corners[i + 1]
        length = self._ends[i + 1] - self._ends[i]
        fraction = (along - self._ends[i]) / length if length else 0.0
        heading = math.atan2(y1 - y0, x1 - x0)
        return x0 + fraction * (x1 - x0), y0 + fraction * (y1 - y0), heading

    def legs(self, time_s: float) -> NDArray[np.float64]:
        """The legs as two circles `(2, 3)` of x, y, radius, which swing as the person walks."""
        x, y, heading = self.pose(time_s)
        swing = 0.5 * STRIDE_M * math.sin(2.0 * math.pi * self.distance_m(time_s) / (2.0 * STRIDE_M)) * 0.6
        cos, sin = math.cos(heading), math.sin(heading)
        radius = self.person.leg_radius_m
        sides = ((swing, LEG_OFFSET_M), (-swing, -LEG_OFFSET_M))
        return np.array([(x + f * cos - s * sin, y + f * sin + s * cos, radius) for f, s in sides])

    def _extend(self) -> None:
        """Append a batch of distances. Speeds are a first-order process around the mean, never negative."""
        decay = math.exp(-STEP_S / SPEED_CORRELATION_S)
        noise = self.person.speed_deviation_mps * math.sqrt(1.0 - decay * decay)
        for draw in self._rng.standard_normal(STEPS_AT_ONCE).tolist():
            self._deviation = decay * self._deviation + noise * draw
            speed = max(self.person.speed_mps + self._deviation, 0.0)
            self._distances.append(self._distances[-1] + speed * STEP_S)
