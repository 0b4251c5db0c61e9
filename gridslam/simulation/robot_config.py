"""The section `robot` of a world file: what it is built like, how it fails, and where it drives."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, PositiveFloat, model_validator

from gridslam.config.base import StrictModel
from gridslam.simulation.shapes import NotNegative, Point, PoseDeg, Share


class GripLosses(StrictModel):
    """Moments at which wheels spin: on a threshold, a cable, a wet spot.

    They come at random, `per_km` on average. Half of them take both wheels, which lose up to `both_wheels_m` of their travel; the
    others take one wheel, which loses up to `one_wheel_m` and so yaws the robot. A spinning wheel loses half of its travel.
    """

    per_km: PositiveFloat
    both_wheels_m: NotNegative = 0.3
    one_wheel_m: NotNegative = 0.05


class Wheels(StrictModel):
    """The drive as its maker describes it, and how it differs from that.

    Slip is a share of the wheel's way that is lost (or gained), the same for neighbouring moments: it has the deviation
    `slip_deviation` and forgets itself over `slip_length_s`. Turning rubs the wheels sideways: of every turn the share
    `turn_slip` is lost.
    """

    radius_m: PositiveFloat = 0.1
    base_m: PositiveFloat = 0.4
    left_radius_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0  # share by which the true one is larger
    right_radius_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    base_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    error_deviation: Annotated[float, Field(ge=0.0, lt=0.1)] = 0.0  # of the three errors, drawn once per seed
    slip_mean: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    slip_deviation: Annotated[float, Field(ge=0.0, lt=0.5)] = 0.0
    slip_length_s: PositiveFloat = 2.0
    turn_slip: Share = 0.0
    grip_losses: GripLosses | None = None
    acceleration_mps2: PositiveFloat = 0.8
    max_speed_mps: PositiveFloat = 1.5


class Stops(StrictModel):
    """The robot stands still for a scan each time it has driven `every_m`."""

    every_m: PositiveFloat
    settle_s: NotNegative = 0.3


class Motion(StrictModel):
    """A part of a driven path: so many seconds with these speeds."""

    seconds: PositiveFloat
    forward_mps: float = 0.0
    turn_radps: float = 0.0


class Robot(StrictModel):
    """Where the robot begins and how it drives: to way points, or as `path` says (each of its parts counts as a way point)."""

    start: PoseDeg
    route: tuple[Point, ...] = Field(default=(), max_length=10_000)
    path: tuple[Motion, ...] = Field(default=(), max_length=100_000)
    laps: Annotated[int, Field(ge=1, le=1000)] = 1
    speed_mps: PositiveFloat = 0.6
    turn_radps: PositiveFloat = 0.8
    arrival_m: PositiveFloat = 0.25
    radius_m: PositiveFloat = 0.25
    wait_at_start_s: NotNegative = 1.0
    stops: Stops | None = None
    wheels: Wheels = Wheels()

    @model_validator(mode="after")
    def _one_way(self) -> Robot:
        if self.route and self.path:
            raise ValueError("give either a route of way points or a driven path, not both")
        if self.path and self.stops:
            raise ValueError("stops go with a route; in a path, a part without speeds stops the robot")
        return self
