"""Wheels that lose their grip now and then: a short loss of travel, of both wheels or of one."""

from __future__ import annotations

import numpy as np

from gridslam.simulation.driving.robot_config import GripLosses

SPINNING = 0.5  # fraction of a wheel's travel that is lost while it spins


class Grip:
    """Travel of the wheels over the ground, step by step, with random losses of grip."""

    def __init__(self, config: GripLosses, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._travel_to_next_m = self._draw_travel()
        self._to_lose_m = [0.0, 0.0]

    def kept(self, left_m: float, right_m: float) -> tuple[float, float]:
        """The travel (m) of both wheels over the ground in a step, given their travel without losses."""
        self._travel_to_next_m -= 0.5 * (abs(left_m) + abs(right_m))
        if self._travel_to_next_m <= 0.0:
            self._travel_to_next_m = self._draw_travel()
            self._start_loss()
        if not any(self._to_lose_m):
            return left_m, right_m
        return self._lose(0, left_m), self._lose(1, right_m)

    def _draw_travel(self) -> float:
        return float(self._rng.exponential(1000.0 / self._config.per_km))

    def _start_loss(self) -> None:
        """Half of the losses take both wheels, a quarter the left one, a quarter the right one."""
        draw, size = self._rng.random(2).tolist()
        if draw < 0.5:
            self._to_lose_m = [size * self._config.both_wheels_m] * 2
        else:
            self._to_lose_m[int(draw < 0.75)] = size * self._config.one_wheel_m

    def _lose(self, wheel: int, travel_m: float) -> float:
        lost = min(SPINNING * abs(travel_m), self._to_lose_m[wheel])
        self._to_lose_m[wheel] -= lost
        return travel_m - (lost if travel_m > 0.0 else -lost)
