"""The section `sensors` of a world file: what the robot carries, where it is mounted, and how it errs.

Every stamp of a stream is late by `latency_s` (as a driver stamps what it receives), with the deviation `jitter_s`; the
share `missing` of the messages is lost.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, PositiveFloat, model_validator

from gridslam.config.base import StrictModel
from gridslam.simulation.shapes import NotNegative, Share


class SensorExtrinsics(StrictModel):
    """A sensor's place on the robot."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0


class Stream(StrictModel):
    """How often messages come, and how regularly."""

    rate_hz: Annotated[float, Field(gt=0.0, le=100.0)] = 10.0
    latency_s: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    jitter_s: Annotated[float, Field(ge=0.0, lt=0.1)] = 0.0
    missing: Share = 0.0


class Lidar(Stream):
    """A scanner in the plane. The deviation of a range is

    sigma = (noise_m + noise_per_m * range) * (1 + grazing_gain * (1 / cos(incidence) - 1)), at most 10 times its first factor;

    the share `tail_share` of the readings has `tail_scale` times that. A beam that is `divergence_deg` wide and falls on two
    surfaces `mixing_m` or more apart reads something in between with the probability `mixing_share`.
    """

    frame: str = "laser"
    extrinsics: SensorExtrinsics = SensorExtrinsics()
    beams: Annotated[int, Field(ge=2, le=10_000)] = 360
    field_of_view_deg: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0
    range_min_m: PositiveFloat = 0.1
    range_max_m: PositiveFloat = 25.0
    sweep_s: NotNegative = 0.1  # from the first beam to the last
    resolution_m: NotNegative = 0.001
    noise_m: NotNegative = 0.01
    noise_per_m: NotNegative = 0.0005
    grazing_gain: NotNegative = 0.15
    tail_share: Share = 0.01
    tail_scale: PositiveFloat = 8.0
    bias_m: float = 0.0
    dropout: Share = 0.002  # of all beams
    grazing_dropout: Share = 0.3  # more, at an incidence of 90 degrees on a black surface
    stray: Share = 0.0005  # readings from dust, anywhere before the surface
    divergence_deg: NotNegative = 0.3
    mixing_m: PositiveFloat = 0.1
    mixing_share: Share = 0.6

    @model_validator(mode="after")
    def _possible(self) -> Lidar:
        if self.range_min_m >= self.range_max_m:
            raise ValueError("range_min_m must be below range_max_m")
        if self.sweep_s > 1.0 / self.rate_hz + 1e-9:
            raise ValueError(f"a sweep of {self.sweep_s:g} s does not fit {self.rate_hz:g} scans a second")
        return self


class WheelOdometry(Stream):
    """Poses (and, where `publish_wheels`, wheel angles) from the encoders, with the maker's wheel radius and base."""

    rate_hz: Annotated[float, Field(gt=0.0, le=100.0)] = 20.0
    ticks_per_turn: Annotated[int, Field(ge=0)] = 2048  # 0: without quantisation
    publish_odometry: bool = True
    publish_wheels: bool = False


class Gyro(Stream):
    """Turn rate: scale * true + bias + noise, the bias beginning at `bias_deviation_radps` and walking."""

    frame: str = "imu"
    rate_hz: Annotated[float, Field(gt=0.0, le=100.0)] = 50.0
    noise_radps: NotNegative = 0.002
    bias_deviation_radps: NotNegative = 0.002
    walk_radps_per_sqrt_s: NotNegative = 0.0001
    scale_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0


class Infrared(StrictModel):
    """A triangulating ranger on a servo, swept while the robot stands.

    The deviation of a reading is noise_m + noise_per_m2 * range^2. The spot is `spot_m` wide: past an edge the reading is pulled
    between both surfaces or beyond; at grazing angles it is short by `grazing_bias_m` / cos. Below `range_min_m` the
    response folds back (too far), beyond `range_max_m` it fades out: such readings are recorded as they come.
    """

    name: str = Field(min_length=1)
    extrinsics: SensorExtrinsics = SensorExtrinsics()
    range_min_m: PositiveFloat = 0.1
    range_max_m: PositiveFloat = 0.8
    from_deg: float = -60.0
    to_deg: float = 60.0
    step_deg: PositiveFloat = 1.0
    seconds_per_step: PositiveFloat = 0.02
    servo_deviation_deg: NotNegative = 0.3
    noise_m: NotNegative = 0.003
    noise_per_m2: NotNegative = 0.02
    spot_m: NotNegative = 0.02
    edge_wrong: Share = 0.5
    grazing_bias_m: NotNegative = 0.002
    outliers: Share = 0.005


class Antenna(Stream):
    """A reader whose round reads a tag when the power that comes back exceeds the threshold.

    power (dB) = gain - 40 log10(distance / 1 m) - 12 (bearing / half_power_deg)^2 + 20 log10(cos of the tag's turn, at least
    0.1) - `wall_loss_db` when anything stands between + fading (normal, `fading_db`); read when power > 0, unless missed
    all the same.
    """

    name: str = Field(min_length=1)
    extrinsics: SensorExtrinsics = SensorExtrinsics()
    rate_hz: Annotated[float, Field(gt=0.0, le=100.0)] = 2.0
    gain_db: float = 9.0
    half_power_deg: PositiveFloat = 70.0
    fading_db: PositiveFloat = 3.0
    wall_loss_db: NotNegative = 15.0
    missed: Share = 0.05
    stray: Share = 0.002  # rounds that hold a tag from anywhere in the world


class Fixes(Stream):
    """Absolute poses from outside: stamped when taken, delivered `delay_s` later, some of them wrong."""

    frame: str = "map"
    rate_hz: Annotated[float, Field(gt=0.0, le=100.0)] = 2.0
    delay_s: NotNegative = 0.2
    noise_m: PositiveFloat = 0.03
    noise_deg: PositiveFloat = 1.0
    outliers: Share = 0.03
    outlier_m: NotNegative = 1.0
