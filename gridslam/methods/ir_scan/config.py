"""The settings of `ir-scan`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gridslam.config.base import NotNegative, Positive, StrictModel


class RangerLimits(StrictModel):
    """Valid range of one ranger; replaces the limits in the log."""

    min_m: NotNegative = Field(
        description="Readings up to this range, in metres, are dropped. Raise it if the ranger sees the robot itself."
    )
    max_m: Positive = Field(
        description="Readings from this range on, in metres, are dropped. Lower it for a ranger that is unreliable far away."
    )


class WheelConfig(StrictModel):
    """Sensors that give the odometry (paper section 2.6)."""

    wheel_radius_m: Positive | None = Field(
        None,
        description="Wheel radius in metres. With wheel_base_m the log's wheel angles are used; without both, its "
        "odometry.",
    )
    wheel_base_m: Positive | None = Field(
        None,
        description="Distance between the two wheels in metres.",
    )
    use_gyro: bool = Field(
        True, description="Correct the yaw of wheels or odometry by the gyro; false ignores the gyro."
    )

    @model_validator(mode="after")
    def _both_or_none(self) -> WheelConfig:
        if (self.wheel_radius_m is None) != (self.wheel_base_m is None):
            raise ValueError("wheel_radius_m and wheel_base_m go together: give both or none")
        return self


class ReadingsConfig(StrictModel):
    """Selection of the readings (paper section 2.5), and their noise."""

    neighbour_m: Positive = Field(
        0.05,
        description="The paper's T, in metres: neighbouring readings that differ by less support each other. Raise it "
        "for long ranges and coarse steps; more wild readings are used then.",
    )
    limits: dict[str, RangerLimits] = Field(
        default_factory=dict,
        description="Valid range of single rangers, by sensor name; the others have the log's limits.",
    )
    noise_m: Positive = Field(
        0.004,
        description="Standard deviation of a reading at zero range, in metres. Raise it for a poor sensor: its readings "
        "then weigh less.",
    )
    noise_per_m2: NotNegative = Field(
        0.015,
        description="Standard deviation that the square of the range adds to a reading, in metres per m2. Raise it "
        "where far readings are poor: they then weigh less.",
    )
    bearing_rad: NotNegative = Field(
        0.006,
        description="Standard deviation of a servo's angle, in rad. Raise it for a servo with play: far readings of "
        "slanted walls then weigh less.",
    )


class MatchingConfig(StrictModel):
    """Matching of a scan to the map at each stop."""

    kind: Literal["search", "shift", "none"] = Field(
        "search",
        description="search: shift and rotation with the odometry as prior, refined on the lines of the walls; shift: the "
        "paper's whole-cell shifts without rotation (2.6); none: odometry and absolute poses alone.",
    )
    window_cells: int = Field(
        10,
        ge=0,
        le=200,
        description="Largest number of cells by which a scan is shifted to each side. Raise it for worse odometry; the time "
        "grows with its square.",
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
        0.06,
        description="search: largest rotation tried to each side, in rad. Raise it for worse odometry; it costs time.",
    )
    min_points: int = Field(
        10,
        ge=1,
        description="Number of reliable readings below which a scan is not matched. Raise it if short scans are matched "
        "wrongly; they then keep the odometry.",
    )
    max_position_std_m: Positive = Field(
        0.04,
        description="search: standard deviation of the position over the window, in metres, above which a match is "
        "refused as ambiguous. Raise it to accept less certain matches.",
    )
    min_inlier_ratio: float = Field(
        0.3,
        ge=0.0,
        le=1.0,
        description="shift: smallest fraction of readings on occupied cells at which a scan counts as matched. Raise it "
        "if scans are matched to wrong walls.",
    )
    tie_sigmas: NotNegative = Field(
        2.5,
        description="shift: number of standard errors of the difference up to which two sums tie; the smallest shift "
        "wins. Raise it to trust the odometry more; 0: only equal sums tie.",
    )
    delay_stops: int = Field(
        10,
        ge=0,
        description="shift, mapping: number of stops after which a scan enters the map. Raise it to keep recent "
        "odometry errors out of the map that is matched against.",
    )


class AdvancedMotion(StrictModel):
    """Noise of wheels and gyro in the extended Kalman filter (paper section 2.6)."""

    forward_std_m: Positive = Field(
        0.012,
        description="Standard deviation along the path after 1 m, in metres; grows with the root of the distance. Raise "
        "it for wheels that slip: odometry then weighs less.",
    )
    lateral_std_m: Positive = Field(
        0.003,
        description="Standard deviation across the path after 1 m, in metres; grows with the root of the distance. "
        "Raise it for a robot that drifts sideways: odometry then weighs less.",
    )
    yaw_std_per_m_rad: Positive = Field(
        0.06,
        description="Standard deviation of the wheels' yaw after 1 m, in rad; grows with the root of the distance. "
        "Raise it for uneven floors: the wheels' yaw then weighs less.",
    )
    yaw_std_per_rad_rad: Positive = Field(
        0.03,
        description="Standard deviation of the wheels' yaw after 1 rad, in rad; grows with the root of the rotation. "
        "Raise it for wheels that slip in turns: their yaw then weighs less.",
    )
    gyro_std_rad: Positive = Field(
        0.001,
        description="Standard deviation of the gyro's yaw after 1 s, in rad; grows with the root of the time. Raise it "
        "for a noisy gyro: its yaw then weighs less.",
    )
    gyro_bias_std_radps: NotNegative = Field(
        0.02,
        description="Standard deviation of the gyro's bias at the start, in rad/s. Raise it for a gyro with a large "
        "bias: the gyro weighs less until the bias is known.",
    )


class IrScanAdvancedConfig(StrictModel):
    """Settings that rarely need a change."""

    memory_limit_mb: Positive = Field(
        512.0,
        description="Largest memory of one grid in MB; a run that needs more ends with an error. Raise it for large or "
        "fine maps.",
    )
    start_std: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (0.05, 0.05, 0.03),
        description="localize: standard deviations of the start pose: x (m), y (m), yaw (rad). Raise them if the start "
        "is only roughly known.",
    )
    matching: AdvancedMatching = AdvancedMatching()
    motion: AdvancedMotion = AdvancedMotion()


class IrScanConfig(StrictModel):
    """Mapping and localization with infrared rangers on servos."""

    name: Literal["ir-scan"] = "ir-scan"
    start: tuple[float, float, float] | None = Field(
        None,
        description="Pose in the map at the start of the log: x (m), y (m), yaw (rad). Absent: the origin.",
    )
    resolution_m: Annotated[float, Field(gt=0.0005, le=1.0)] = Field(
        0.01,
        description="Size of a map cell in metres. Raise it for a faster run and a coarser map.",
    )
    motion: WheelConfig = WheelConfig()
    readings: ReadingsConfig = ReadingsConfig()
    matching: MatchingConfig = MatchingConfig()
    adjustment: AdjustmentConfig = AdjustmentConfig()
    drawing: DrawingConfig = DrawingConfig()
    advanced: IrScanAdvancedConfig = IrScanAdvancedConfig()
