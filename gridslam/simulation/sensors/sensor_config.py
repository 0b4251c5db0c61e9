"""The section `sensors` of a world file: sensors, their extrinsics and their errors.

Stamps of a stream are late by `latency_s` (a driver stamps a message on arrival), with the standard deviation `jitter_s`.
The fraction `missing` of the messages is lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, model_validator

from gridslam.config.base import StrictModel
from gridslam.simulation.shapes import Fraction, NotNegative, Number, Positive, Rate

MAX_SWEEP_STEPS = 10_000
# Every format keeps a name without control characters and without blanks at its ends.
NAME_PATTERN = r"^[^\s\x00-\x1f\x7f]([^\x00-\x1f\x7f]*[^\s\x00-\x1f\x7f])?$"
Bearing = Annotated[float, Field(ge=-360.0, le=360.0)]  # degrees


def _refuse_range_limits(low_m: float, high_m: float) -> None:
    """Raises ValueError: the limits are not in order, or no longer are as the numbers of 32 bits that a log has."""
    if not np.float32(low_m) < np.float32(high_m):
        raise ValueError("range_min_m must be below range_max_m")


class SensorExtrinsics(StrictModel):
    """Pose of a sensor in the base frame: metres and degrees, pitch positive downwards."""

    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0
    yaw_deg: Number = 0.0
    pitch_deg: Number = 0.0


class Stream(StrictModel):
    """Rate, delay and losses of a stream of messages."""

    rate_hz: Rate = 10.0
    latency_s: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    jitter_s: Annotated[float, Field(ge=0.0, lt=0.1)] = 0.0
    missing: Fraction = 0.0


class Lidar(Stream):
    """A planar scanner. The standard deviation of a range is

    sigma = (noise_m + noise_per_m * range) * (1 + grazing_gain * (1 / cos(incidence) - 1)), at most 10 times the first factor.

    The fraction `tail_fraction` of the readings has `tail_scale` times that. A beam has the width `divergence_deg`; where it
    falls on two surfaces at least `mixing_gap_m` apart, the reading lies between them with the probability
    `mixing_probability`.
    """

    former_keys: ClassVar[Mapping[str, str]] = {
        "mounting": "extrinsics",
        "tail_share": "tail_fraction",
        "stray": "outliers",
        "mixing_m": "mixing_gap_m",
        "mixing_share": "mixing_probability",
    }

    frame: str = "laser"
    extrinsics: SensorExtrinsics = SensorExtrinsics()
    beams: Annotated[int, Field(ge=2, le=10_000)] = 360
    field_of_view_deg: Annotated[float, Field(ge=0.1, le=360.0)] = 360.0
    range_min_m: Positive = 0.1
    range_max_m: Positive = 25.0
    sweep_s: NotNegative = 0.1  # from the first beam to the last
    resolution_m: NotNegative = 0.001
    noise_m: NotNegative = 0.01
    noise_per_m: NotNegative = 0.0005
    grazing_gain: NotNegative = 0.15
    tail_fraction: Fraction = 0.01
    tail_scale: Positive = 8.0
    bias_m: Number = 0.0
    dropout: Fraction = 0.002  # fraction of all beams that have no echo
    grazing_dropout: Fraction = 0.3  # added at an incidence of 90 degrees on a black surface
    outliers: Fraction = 0.0005  # readings of dust, anywhere before the surface
    divergence_deg: NotNegative = 0.3
    mixing_gap_m: Positive = 0.1
    mixing_probability: Fraction = 0.6

    @model_validator(mode="after")
    def _possible(self) -> Lidar:
        _refuse_range_limits(self.range_min_m, self.range_max_m)
        if self.sweep_s > 1.0 / self.rate_hz + 1e-9:
            raise ValueError(f"a sweep of {self.sweep_s:g} s does not fit {self.rate_hz:g} scans a second")
        return self


class WheelOdometry(Stream):
    """Poses from the encoders by the nominal wheel radius and base; with `publish_wheels` also wheel angles."""

    former_keys: ClassVar[Mapping[str, str]] = {"ticks_per_turn": "ticks_per_revolution"}

    rate_hz: Rate = 20.0
    ticks_per_revolution: Annotated[int, Field(ge=0, le=10**9)] = 2048  # 0: no quantisation
    publish_odometry: bool = True
    publish_wheels: bool = False


class Gyro(Stream):
    """Yaw rate: (1 + scale_error) * true rate + bias + noise.

    The bias starts at a random value of standard deviation `bias_deviation_radps` and walks randomly.
    """

    former_keys: ClassVar[Mapping[str, str]] = {"walk_radps_per_sqrt_s": "bias_walk_radps_per_sqrt_s"}

    frame: str = "imu"
    rate_hz: Rate = 50.0
    noise_radps: NotNegative = 0.002
    bias_deviation_radps: NotNegative = 0.002
    bias_walk_radps_per_sqrt_s: NotNegative = 0.0001
    scale_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0


class Infrared(StrictModel):
    """A triangulating ranger on a servo, swept while the robot stands.

    The standard deviation of a reading is noise_m + noise_per_m2 * range^2. Where the beam (`beam_width_m` wide) falls on an
    edge, the reading lies between both surfaces or beyond them with the probability `edge_errors`. At grazing incidence it is
    short by grazing_bias_m * (1 / cos(incidence) - 1). Below `range_min_m` the response folds back to larger readings.
    Readings outside the valid range are recorded all the same.
    """

    former_keys: ClassVar[Mapping[str, str]] = {
        "mounting": "extrinsics",
        "spot_m": "beam_width_m",
        "edge_wrong": "edge_errors",
    }

    name: str = Field(min_length=1, pattern=NAME_PATTERN)
    extrinsics: SensorExtrinsics = SensorExtrinsics()
    range_min_m: Positive = 0.1
    range_max_m: Positive = 0.8
    from_deg: Bearing = -60.0
    to_deg: Bearing = 60.0
    step_deg: Positive = 1.0
    seconds_per_step: Positive = 0.02
    servo_deviation_deg: NotNegative = 0.3
    noise_m: NotNegative = 0.003
    noise_per_m2: NotNegative = 0.02
    beam_width_m: NotNegative = 0.02
    edge_errors: Fraction = 0.5
    grazing_bias_m: NotNegative = 0.002
    outliers: Fraction = 0.005

    @model_validator(mode="after")
    def _possible(self) -> Infrared:
        _refuse_range_limits(self.range_min_m, self.range_max_m)
        if self.from_deg > self.to_deg:
            raise ValueError("from_deg must not be above to_deg")
        if (self.to_deg - self.from_deg) / self.step_deg > MAX_SWEEP_STEPS:
            raise ValueError(f"a sweep has more than {MAX_SWEEP_STEPS} steps; raise step_deg")
        return self


class Antenna(Stream):
    """An RFID antenna. An inventory round reads a tag when its power is above the threshold:

    power (dB) = gain_db - 40 log10(distance / 1 m) - 12 (bearing / half_power_deg)^2
                 + 20 log10(cosine of the tag's orientation, at least 0.1)
                 - wall_loss_db where a surface blocks the line of sight + normal fading of `fading_db`.

    The fraction `missed` of the readable tags is not read.
    """

    former_keys: ClassVar[Mapping[str, str]] = {"mounting": "extrinsics", "stray": "false_reads"}

    name: str = Field(min_length=1, pattern=NAME_PATTERN)
    extrinsics: SensorExtrinsics = SensorExtrinsics()
    rate_hz: Rate = 2.0
    gain_db: Number = 9.0
    half_power_deg: Positive = 70.0
    fading_db: Positive = 3.0
    wall_loss_db: NotNegative = 15.0
    missed: Fraction = 0.05
    false_reads: Fraction = 0.002  # fraction of the rounds that also report a random tag of the world


class AbsolutePoses(Stream):
    """Absolute poses from an external source: stamped when measured, received `delay_s` later, the fraction `outliers` wrong by
    0.5 to 1.5 times `outlier_m`.
    """

    frame: str = "map"
    rate_hz: Rate = 2.0
    delay_s: NotNegative = 0.2
    noise_m: Positive = 0.03
    noise_deg: Positive = 1.0
    outliers: Fraction = 0.03
    outlier_m: NotNegative = 1.0
