"""The settings of `ir-scan`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gridslam.config.base import StrictModel

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class MotionConfig(StrictModel):
    """Odometry out of encoders and gyro (paper section 2.6): an extended Kalman filter weighs them by these deviations."""

    wheel_radius_m: Positive | None = Field(
        None, description="with wheel_base_m: use wheel angles; absent: the log's odometry"
    )
    wheel_base_m: Positive | None = Field(None, description="distance between the wheels, m")
    use_gyro: bool = Field(True, description="false: encoders alone")
    forward_per_root_m: Positive = Field(0.012, description="deviation of the way after 1 m, m")
    sideways_per_root_m: Positive = Field(0.003, description="deviation across the way after 1 m, m")
    turn_per_root_m: Positive = Field(0.06, description="deviation of the wheels' heading after 1 m, rad")
    turn_per_root_rad: Positive = Field(0.03, description="and after turning by 1 rad, rad")
    gyro_per_root_s: Positive = Field(0.001, description="deviation of the gyro's heading after 1 s, rad")
    gyro_scale: NotNegative = Field(0.003, description="share of a turn that the gyro errs by")
    bias_radps: NotNegative = Field(0.02, description="deviation of the gyro's bias at the start, rad/s")
    bias_per_root_s: NotNegative = Field(1e-4, description="how far the bias walks in 1 s, rad/s")
    max_speed_mps: Positive = Field(3.0, description="faster motion is a jump of the counters")
    max_turn_radps: Positive = Field(10.0, description="faster turning is a jump of the counters")

    @model_validator(mode="after")
    def _both_or_none(self) -> MotionConfig:
        if (self.wheel_radius_m is None) != (self.wheel_base_m is None):
            raise ValueError("wheel_radius_m and wheel_base_m go together: give both or none")
        return self


class SweepConfig(StrictModel):
    """What ends a scan."""

    gap_s: Positive = Field(1.0, description="silence of the rangers")
    moved_m: Positive = Field(0.005, description="the robot went on by so much")
    moved_rad: Positive = Field(0.02, description="or turned by so much")
    back_rad: Positive = Field(0.35, description="a servo turned back by so much: its next sweep")


class RangerLimits(StrictModel):
    """Where a ranger may be trusted; wins over what the log says."""

    min_m: NotNegative
    max_m: Positive


class ReadingsConfig(StrictModel):
    """Which readings are used (paper section 2.5), and how well they are known."""

    neighbour_m: Positive = Field(
        0.05, description="T: neighbouring readings that differ by less support each other"
    )
    limits: dict[str, RangerLimits] = Field(
        default_factory=dict, description="valid range by sensor; absent: the log's"
    )
    noise_m: Positive = Field(0.004, description="deviation of a reading at no distance, m")
    noise_per_m2: NotNegative = Field(0.015, description="and what the square of the range adds, 1/m")
    bearing_rad: NotNegative = Field(0.006, description="deviation of a servo's angle")


class ShiftMatching(StrictModel):
    """The paper's match (2.6): whole cells, no rotation; the largest sum of pos wins, ties go to the smallest shift.

    What a tie is the paper leaves open, and when a scan enters the map. Sums of a few hundred noisy points are never
    equal: along a bare wall all shifts say the same, and the largest of their sums is an accident. And a map that holds the
    scans just taken confirms the error that the robot has had since.
    """

    kind: Literal["shift"] = "shift"
    window_cells: int = Field(10, ge=0, le=200, description="shifts tried to each side")
    least_points: int = Field(10, ge=1, description="with fewer reliable points there is no correction")
    least_share: float = Field(
        0.3, ge=0.0, le=1.0, description="a match must put this share of the points on occupied cells"
    )
    tie_sigmas: NotNegative = Field(
        2.5,
        description="sums tie that differ by at most so many standard errors of their difference; 0: equal sums only",
    )
    delay_stops: int = Field(
        10, ge=0, description="mapping: a scan enters the map so many stops later; the last ones err alike"
    )


class SearchMatching(StrictModel):
    """A search over shift and rotation with the odometry as prior, refined to fractions of a cell on the lines of the walls."""

    kind: Literal["search"] = "search"
    window_cells: int = Field(10, ge=0, le=200, description="shifts tried to each side")
    rotation_rad: NotNegative = Field(0.06, description="rotations tried to each side")
    least_points: int = Field(10, ge=1, description="with fewer reliable points there is no correction")
    point_weight: Positive = Field(
        0.3, description="log-likelihood that a point on a wall adds: neighbours err together"
    )
    ambiguous_m: Positive = Field(
        0.04, description="refused when the search leaves the position more uncertain (deviation)"
    )
    line_window_m: Positive | None = Field(
        None,
        description="points within this window make the line of a wall; absent: by the readings' spacing",
    )


class NoMatching(StrictModel):
    """Odometry, and fixes where the log has them, alone."""

    kind: Literal["none"] = "none"


Matching = Annotated[ShiftMatching | SearchMatching | NoMatching, Field(discriminator="kind")]


class AdjustmentConfig(StrictModel):
    """After the last scan: all stops at once are adjusted so that their readings share the lines of the walls."""

    enabled: bool = Field(True, description="off: stops stay where they were found on the way")
    cell_m: Positive | None = Field(
        None,
        description="a piece of wall of this size is taken for straight; absent: by the readings' spacing",
    )
    iterations: int = Field(15, ge=1, le=200, description="most steps of Gauss-Newton")


class DrawingConfig(StrictModel):
    """How the finished map is drawn."""

    kind: Literal["pos", "surfaces"] = Field(
        "surfaces",
        description="pos: the paper's grid as it is; surfaces: lines of walls, cleared by later beams",
    )
    window_m: Positive | None = Field(
        None, description="readings within this window make a piece of wall; absent: by the readings' spacing"
    )
    least_readings: int = Field(3, ge=1, description="a wall needs so many readings in the window")
    gap_m: NotNegative | None = Field(
        None, description="neighbouring readings of one wall this near are joined; absent: by their spacing"
    )
    crossed_weight: NotNegative = Field(
        0.35, description="evidence of a beam through a cell, in readings in it"
    )


class IrScanConfig(StrictModel):
    """Mapping and localization with infrared rangers on servos."""

    name: Literal["ir-scan"] = "ir-scan"
    start: tuple[float, float, float] | None = Field(
        None, description="x (m), y (m), yaw (rad) of the first pose in the map; absent: the map's origin"
    )
    start_deviation: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (0.05, 0.05, 0.03), description="localize: standard deviations of the start pose, m, m, rad"
    )
    resolution_m: Annotated[float, Field(gt=0.0005, le=1.0)] = Field(0.01, description="cell of the map, m")
    memory_limit_mb: Positive = Field(512.0, description="the run ends with an error rather than take more")
    motion: MotionConfig = MotionConfig()
    sweep: SweepConfig = SweepConfig()
    readings: ReadingsConfig = ReadingsConfig()
    matching: Matching = SearchMatching()
    adjustment: AdjustmentConfig = AdjustmentConfig()
    drawing: DrawingConfig = DrawingConfig()
