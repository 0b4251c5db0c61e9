"""The settings of `ir-scan`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gridslam.config.base import StrictModel

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class RangerLimits(StrictModel):
    """Valid range of one ranger, m; replaces the limits in the log."""

    min_m: NotNegative
    max_m: Positive


class WheelConfig(StrictModel):
    """Which sensors give the odometry (paper section 2.6)."""

    wheel_radius_m: Positive | None = Field(
        None,
        description="Wheel radius, m. With wheel_base_m the log's wheel angles are used; without both, its odometry.",
    )
    wheel_base_m: Positive | None = Field(None, description="Distance between the two wheels, m.")
    use_gyro: bool = Field(
        True, description="Correct the yaw of wheels or odometry by the gyro; false ignores the gyro."
    )

    @model_validator(mode="after")
    def _both_or_none(self) -> WheelConfig:
        if (self.wheel_radius_m is None) != (self.wheel_base_m is None):
            raise ValueError("wheel_radius_m and wheel_base_m go together: give both or none")
        return self


class ReadingsConfig(StrictModel):
    """Which readings are used (paper section 2.5), and their noise."""

    neighbour_m: Positive = Field(
        0.05,
        description="The paper's T, m: neighbouring readings that differ by less support each other. Raise it for long "
        "ranges and coarse steps; more wild readings are used then.",
    )
    limits: dict[str, RangerLimits] = Field(
        default_factory=dict,
        description="Valid range of single rangers by sensor name, {min_m, max_m}; others have the log's limits.",
    )
    noise_m: Positive = Field(
        0.004,
        description="Standard deviation of a reading at zero range, m. Higher values weigh readings less.",
    )
    noise_per_m2: NotNegative = Field(
        0.015, description="Standard deviation that the square of the range adds to a reading, m per m2."
    )
    bearing_rad: NotNegative = Field(0.006, description="Standard deviation of a servo's angle, rad.")


class MatchingConfig(StrictModel):
    """How a scan is matched to the map at each stop."""

    kind: Literal["search", "shift", "none"] = Field(
        "search",
        description="search: shift and rotation with the odometry as prior, refined on the lines of the walls; shift: the "
        "paper's whole-cell shifts without rotation (2.6); none: odometry and absolute poses alone.",
    )
    window_cells: int = Field(
        10,
        ge=0,
        le=200,
        description="Shifts tried to each side, cells, 0 to 200. Higher values allow worse odometry and cost time.",
    )


class AdjustmentConfig(StrictModel):
    """The adjustment of all stops after the last scan."""

    enabled: bool = Field(
        True,
        description="Adjust all stops together after the last scan so that their readings lie on common walls; false "
        "keeps the poses found stop by stop.",
    )


class DrawingConfig(StrictModel):
    """The drawing of the finished map."""

    kind: Literal["surfaces", "pos"] = Field(
        "surfaces",
        description="surfaces: readings averaged to walls, cleared where beams pass; pos: the paper's grid (2.7, 2.8).",
    )


class AdvancedMatching(StrictModel):
    """Details of the match. The paper leaves min_inlier_ratio, tie_sigmas and delay_stops open; 0 is its literal reading."""

    rotation_rad: NotNegative = Field(
        0.06, description="search: rotations tried to each side, rad. Higher values allow worse odometry."
    )
    min_points: int = Field(
        10, ge=1, description="Number of reliable readings below which a scan is not matched."
    )
    max_position_std_m: Positive = Field(
        0.04,
        description="search: a match is refused as ambiguous when the position's standard deviation over the window "
        "exceeds this, m.",
    )
    min_inlier_ratio: float = Field(
        0.3,
        ge=0.0,
        le=1.0,
        description="shift: smallest fraction of readings on occupied cells at which a scan counts as matched, 0 to 1.",
    )
    tie_sigmas: NotNegative = Field(
        2.5,
        description="shift: two shifts tie when their sums differ by at most this many standard errors of the "
        "difference; the smallest shift wins. 0: only equal sums tie.",
    )
    delay_stops: int = Field(
        10,
        ge=0,
        description="shift, mapping: number of stops after which a scan enters the map. Higher values keep recent "
        "odometry errors out of the map that is matched against.",
    )


class AdvancedMotion(StrictModel):
    """Noise of wheels and gyro in the extended Kalman filter (paper section 2.6), and limits of the motion."""

    forward_std_m: Positive = Field(
        0.012,
        description="Standard deviation along the path after 1 m, m; grows with the root of the distance.",
    )
    lateral_std_m: Positive = Field(
        0.003,
        description="Standard deviation across the path after 1 m, m; grows with the root of the distance.",
    )
    yaw_std_per_m_rad: Positive = Field(
        0.06,
        description="Standard deviation of the wheels' yaw after 1 m, rad; grows with the root of the distance.",
    )
    yaw_std_per_rad_rad: Positive = Field(
        0.03,
        description="Standard deviation of the wheels' yaw after 1 rad, rad; grows with the root of the rotation.",
    )
    gyro_std_rad: Positive = Field(
        0.001,
        description="Standard deviation of the gyro's yaw after 1 s, rad; grows with the root of the time.",
    )
    gyro_bias_std_radps: NotNegative = Field(
        0.02, description="Standard deviation of the gyro's bias at the start, rad/s."
    )


class IrScanAdvancedConfig(StrictModel):
    """Settings that rarely need a change."""

    memory_limit_mb: Positive = Field(
        512.0, description="Memory of one grid, MB, at which the run ends with an error."
    )
    start_std: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (0.05, 0.05, 0.03),
        description="localize: standard deviations of the start pose: x (m), y (m), yaw (rad).",
    )
    matching: AdvancedMatching = AdvancedMatching()
    motion: AdvancedMotion = AdvancedMotion()


class IrScanConfig(StrictModel):
    """Mapping and localization with infrared rangers on servos."""

    name: Literal["ir-scan"] = "ir-scan"
    start: tuple[float, float, float] | None = Field(
        None, description="Pose of the first moment in the map: x (m), y (m), yaw (rad); absent: the origin."
    )
    resolution_m: Annotated[float, Field(gt=0.0005, le=1.0)] = Field(
        0.01, description="Size of a map cell, m, 0.0005 to 1. Higher values are faster and coarser."
    )
    motion: WheelConfig = WheelConfig()
    readings: ReadingsConfig = ReadingsConfig()
    matching: MatchingConfig = MatchingConfig()
    adjustment: AdjustmentConfig = AdjustmentConfig()
    drawing: DrawingConfig = DrawingConfig()
    advanced: IrScanAdvancedConfig = IrScanAdvancedConfig()
