"""The section `robot` of a world file: its drive, the drive's errors, and where it drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, model_validator

from gridslam.config.base import StrictModel
from gridslam.simulation.shapes import Fraction, NotNegative, Number, Point, PoseDeg, Positive

MAX_WAYPOINTS = 1_000_000  # over all laps


class GripLosses(StrictModel):
    """Moments at which wheels spin: on a threshold, a cable, a wet spot.

    They come at random, `per_km` on average. Half of them take both wheels, which lose up to `both_wheels_m` of their travel; the
    others take one wheel, which loses up to `one_wheel_m` and so yaws the robot. A spinning wheel loses half of its travel.
    """

    per_km: Positive
    both_wheels_m: NotNegative = 0.3
    one_wheel_m: NotNegative = 0.05


class Wheels(StrictModel):
    """Nominal geometry of the differential drive, and its errors.

    Slip is the fraction of a wheel's travel that is lost (negative: gained). It is a first-order process per wheel with mean
    `slip_mean`, standard deviation `slip_deviation` and correlation time `slip_correlation_time_s`. Of every rotation of the
    robot the fraction `turn_slip` is lost.
    """

    former_keys: ClassVar[Mapping[str, str]] = {"slip_length_s": "slip_correlation_time_s"}

    radius_m: Positive = 0.1
    base_m: Positive = 0.4
    left_radius_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0  # fraction of the radius
    right_radius_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    base_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    error_deviation: Annotated[float, Field(ge=0.0, lt=0.1)] = 0.0  # of the three errors, drawn once per seed
    slip_mean: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    slip_deviation: Annotated[float, Field(ge=0.0, lt=0.5)] = 0.0
    slip_correlation_time_s: Positive = 2.0
    turn_slip: Fraction = 0.0
    grip_losses: GripLosses | None = None
    acceleration_mps2: Positive = 0.8
    max_speed_mps: Positive = 1.5


class Stops(StrictModel):
    """The robot stops for a sweep every `every_m` metres, and waits `settle_s` before it drives on."""

    every_m: Positive
    settle_s: NotNegative = 0.3


class PathSegment(StrictModel):
    """A segment of an open-loop path: constant speeds for a time."""

    seconds: Positive
    forward_mps: Number = 0.0
    turn_radps: Number = 0.0


class Robot(StrictModel):
    """Start pose of the robot, and its drive: along waypoints (`route`), or open loop along `path`, whose segments count as
    waypoints.
    """

    start: PoseDeg
    route: tuple[Point, ...] = Field(default=(), max_length=10_000)
    path: tuple[PathSegment, ...] = Field(default=(), max_length=100_000)
    laps: Annotated[int, Field(ge=1, le=1000)] = 1
    speed_mps: Positive = 0.6
    turn_radps: Positive = 0.8
    arrival_m: Positive = 0.25
    radius_m: Positive = 0.25
    wait_at_start_s: NotNegative = 1.0
    stops: Stops | None = None
    wheels: Wheels = Wheels()

    @model_validator(mode="after")
    def _one_drive(self) -> Robot:
        if self.route and self.path:
            raise ValueError("give either a route of waypoints or a path, not both")
        if max(len(self.route), len(self.path)) * self.laps > MAX_WAYPOINTS:
            raise ValueError(f"over all laps, there are more than {MAX_WAYPOINTS} waypoints")
        if self.path and self.stops:
            raise ValueError("stops need a route; in a path, a segment without speeds stops the robot")
        return self


def route_length_m(robot: Robot) -> float:
    """Length (m) of the route from the start through all waypoints, or of the path, over all laps."""
    if robot.path:
        return robot.laps * sum(abs(segment.forward_mps) * segment.seconds for segment in robot.path)
    points = np.array([robot.start[:2], *(robot.route * robot.laps)])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
