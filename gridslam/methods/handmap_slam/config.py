"""The settings of `handmap-slam`; everything else is a constant beside the algorithm that uses it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from gridslam.config.base import NotNegative, Positive, StrictModel
from gridslam.lidar_slam.config import (
    LoopClosureConfig,
    MapConfig,
    OdometryConfig,
    PoseGraphConfig,
    ScanConfig,
)


class DrawingInputConfig(StrictModel):
    """Reading of the drawing."""

    walls_are: Literal["auto", "dark", "bright"] = Field(
        "auto",
        description="Colour of the drawn walls; auto infers it from the start pose and from which colour is thin.",
    )
    max_gap: float = Field(
        0.3,
        ge=0.0,
        le=10.0,
        description="Length of gaps in the drawn strokes up to which they are closed, in drawing units (0.1 per pixel). "
        "Raise it for sloppy drawings; above the width of a door it closes doors.",
    )


class LocalizationConfig(StrictModel):
    """Monte Carlo localization in the drawing (paper section 4)."""

    particles: int = Field(
        5000,
        ge=50,
        le=100_000,
        description="Number of particles after the start. Raise it if the robot is lost; it costs time.",
    )
    scale: float | None = Field(
        None,
        gt=0.0,
        description="Scale of the drawing in drawing units (0.1 per pixel) per metre. Absent: estimated. Raise it if "
        "the place is smaller than it was drawn.",
    )
    scale_range: tuple[Positive, Positive] = Field(
        (0.25, 4.0),
        description="Smallest and largest scale considered if none is given, in drawing units per metre. Lower it for a "
        "place much larger than it was drawn, raise it for a smaller one; a wider range is searched more "
        "coarsely.",
    )
    separate_scales: bool = Field(
        True,
        description="Whether the scales along x and y are estimated separately; false: one scale, as in the paper.",
    )
    sigma_m: float = Field(
        0.3,
        gt=0.0,
        description="Standard deviation in metres of walls from where they are drawn. Raise it for inaccurate drawings; "
        "the pose in the drawing becomes less certain.",
    )

    @model_validator(mode="after")
    def _ordered(self) -> LocalizationConfig:
        low, high = self.scale_range
        if not 0.0 < low < high:
            raise ValueError(f"scale_range: expected 0 < smallest < largest, got {low:g}, {high:g}")
        return self


class ExplorationConfig(StrictModel):
    """Settings that only `gridslam explore` uses."""

    visit_frontiers: bool = Field(
        True,
        description="Whether the robot goes on after its tour to where free space borders on unobserved space; "
        "false: it maps what is drawn, as in the paper.",
    )
    max_speed_mps: float = Field(
        0.6,
        gt=0.0,
        description="Top speed in m/s. Lower it to brake in less room.",
    )
    view_range_m: float = Field(
        6.0,
        gt=0.0,
        description="Distance in metres up to which walls count as visible from an observation point. Raise it to visit "
        "fewer points.",
    )
    inflation_radius_m: float = Field(
        0.7,
        gt=0.0,
        description="Distance in metres to obstacles and walls below which paths cost more. Raise it to keep farther "
        "from them.",
    )


class HandmapAdvancedConfig(StrictModel):
    """Settings that are rarely changed."""

    start_std: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (0.5, 0.5, 0.15),
        description="Standard deviations of a given start: x and y in drawing units, yaw in rad. Raise them if the "
        "start is only roughly known.",
    )
    aspect_std: float = Field(
        0.15,
        gt=0.0,
        description="Standard deviation of each of two separate scales about their mean, as a fraction of it. Raise it "
        "(0.4) where width and height of the drawing are out of proportion.",
    )
    revisit_fraction: float = Field(
        0.1,
        ge=0.0,
        lt=1.0,
        description="Fraction of the particles placed at the earlier pose in the drawing when the robot returns to a "
        "place; 0: none, as in the paper. Raise it if the robot loses its place after loops. Used only with "
        "separate_scales: false or front_end: lines.",
    )
    memory_limit_mb: float = Field(
        1024.0,
        gt=0.0,
        description="Largest memory of the maps in MB; a run that needs more ends with an error. Raise it for large or "
        "fine maps.",
    )
    odometry: OdometryConfig = OdometryConfig()
    loop_closure: LoopClosureConfig = LoopClosureConfig()
    exploration: ExplorationConfig = ExplorationConfig()


class HandmapSlamConfig(StrictModel):
    """SLAM with a hand-drawn map as prior."""

    name: Literal["handmap-slam"] = "handmap-slam"
    start: tuple[float, float, float] | None = Field(
        None,
        description="Start pose in the drawing: x, y in drawing units (0.1 per pixel) from the lower left corner, yaw "
        "in rad. Absent: the whole drawing is searched.",
    )
    front_end: Literal["surfaces", "lines"] = Field(
        "surfaces",
        description="Scan tracking; surfaces: against a local map of surfaces; "
        "lines: as in the paper (6.2), heading from lines and point-to-plane ICP.",
    )
    correction: bool = Field(
        True,
        description="Whether drawn lines, observed or missing, correct the position in the drawing (paper section 6.1).",
    )
    drawing: DrawingInputConfig = DrawingInputConfig()
    localization: LocalizationConfig = LocalizationConfig()
    scan: ScanConfig = ScanConfig(max_range_m=60.0)
    map: MapConfig = MapConfig()
    pose_graph: PoseGraphConfig = PoseGraphConfig()
    advanced: HandmapAdvancedConfig = HandmapAdvancedConfig()
