"""The settings of `handmap-slam`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from gridslam.config.base import StrictModel
from gridslam.lidar_slam.config import (
    LoopClosureConfig,
    MapConfig,
    OdometryConfig,
    PoseGraphConfig,
    ScanConfig,
)
from gridslam.methods.handmap_slam.planning_config import ExplorationConfig


class DrawingConfig(StrictModel):
    """How the drawing is read."""

    walls_are: Literal["auto", "dark", "bright"] = Field(
        "auto", description="colour of the walls; auto: found out from the start and from what is thin"
    )
    gap_m: float = Field(
        0.3,
        ge=0.0,
        le=10.0,
        description="gaps in strokes up to here are closed, in drawing metres (0.1 m a pixel)",
    )


class LocalizationConfig(StrictModel):
    """Monte Carlo localization in the drawing (paper section 4)."""

    particles: int = Field(2000, ge=50, le=100_000, description="number of particles while tracking")
    start_particles: int = Field(
        6000, ge=50, le=1_000_000, description="number at the start, pose and scale open"
    )
    start_deviation: tuple[float, float, float] = Field(
        (0.5, 0.5, 0.15), description="standard deviations of the start: x, y (drawing metres), yaw (rad)"
    )
    scale: float | None = Field(
        None, gt=0.0, description="drawing metres (0.1 m a pixel) per metre of the world; absent: found out"
    )
    scale_deviation: float = Field(0.1, gt=0.0, description="relative standard deviation of a given scale")
    scale_range: tuple[float, float] = Field(
        (0.25, 4.0), description="least and largest scale where none is given"
    )
    separate_scales: bool = Field(True, description="scales along x and y are estimated separately")
    aspect_deviation: float = Field(
        0.15, gt=0.0, description="relative standard deviation of one of two separate scales about their mean"
    )
    points: int = Field(90, ge=10, description="most points of a scan that weigh the particles")
    sigma_m: float = Field(
        0.3, gt=0.0, description="standard deviation of a point about a drawn wall, in metres of the world"
    )
    random_share: float = Field(0.15, gt=0.0, lt=1.0, description="share of points that the drawing lacks")
    point_weight: float = Field(
        0.15, gt=0.0, le=1.0, description="power of a point's likelihood: neighbouring points err together"
    )
    translation_floor_m: float = Field(0.02, ge=0.0, description="noise of a step in the drawing")
    translation_per_m: float = Field(
        0.1, ge=0.0, description="more of it per metre of way: the drawing is bent"
    )
    rotation_floor_rad: float = Field(0.005, ge=0.0)
    rotation_per_rad: float = Field(0.02, ge=0.0)
    rotation_per_m_rad: float = Field(0.02, ge=0.0)
    scale_per_root_m: float = Field(
        0.01, ge=0.0, description="relative random walk of the scale along the way"
    )
    aspect_per_root_m: float = Field(0.01, ge=0.0, description="and of its two parts against each other")
    wall_penalty: float = Field(
        1.0,
        ge=0.0,
        description="log-likelihood that a robot loses at each update where the drawing has no free space",
    )
    recall_share: float = Field(
        0.1,
        ge=0.0,
        lt=1.0,
        description="share of particles put where the robot was when it was here before; 0: none",
    )
    recall_m: float = Field(
        1.0, gt=0.0, description="as near as this to an earlier pose it is here again, metres"
    )
    recall_after_m: float = Field(4.0, gt=0.0, description="if it has travelled so far since")
    resample_below: float = Field(
        0.5, gt=0.0, le=1.0, description="resample when N_eff falls below this share"
    )
    update_m: float = Field(0.2, gt=0.0, description="scans weigh the particles after so much travel")
    update_rad: float = Field(0.15, gt=0.0, description="or so much turning")
    cluster_m: float = Field(
        1.0, gt=0.0, description="particles so near (metres of the world) are one belief"
    )
    cluster_rad: float = Field(0.5, gt=0.0)

    @model_validator(mode="after")
    def _ordered(self) -> LocalizationConfig:
        low, high = self.scale_range
        if not 0.0 < low < high:
            raise ValueError(f"scale_range: expected 0 < least < largest, got {low:g}, {high:g}")
        return self


class SearchConfig(StrictModel):
    """Where in the drawing the robot is and how large the drawing is, when no start is given."""

    scales: int = Field(
        17, ge=2, le=100, description="number of scales tried, evenly spaced in the logarithm"
    )
    spacing_m: float = Field(0.4, gt=0.0, description="distance of the places tried, in metres of the world")
    headings: int = Field(72, ge=8)
    points: int = Field(60, ge=8, description="points of the scan used in the coarse search")
    most_poses: int = Field(
        300_000, ge=1000, description="at each scale; on large drawings the spacing grows"
    )
    refined: int = Field(300, ge=1)
    hypotheses: int = Field(60, ge=1, description="best poses of each scale that particles are drawn about")


class LineConfig(StrictModel):
    """Lines of the scan and of the drawing, and when a drawn line counts as observed (paper section 6.1)."""

    tolerance_m: float = Field(0.03, gt=0.0, description="farthest point of a line of the scan")
    gap_m: float = Field(3.0, gt=0.0, description="a line of the scan ends where it has no point for so long")
    least_points: int = Field(12, ge=3, description="points of a line of the scan at least")
    most_lines: int = Field(8, ge=1, description="most lines of a scan")
    hypotheses: int = Field(80, ge=1, description="RANSAC draws for each line")
    least_length_m: float = Field(0.8, gt=0.0, description="shorter lines of the scan do not count")
    turn_length_m: float = Field(
        2.5,
        gt=0.0,
        description="lines of the scan turn the heading from this length on: shorter ones lie on curves",
    )
    drawn_length_m: float = Field(1.0, gt=0.0, description="least length of a drawn line, drawing metres")
    drawn_gap_m: float = Field(0.5, ge=0.0, description="gaps in a drawn line, drawing metres")
    drawn_votes: int = Field(8, ge=1, description="least votes of the Hough transform")
    beams: int = Field(180, ge=16, description="beams of the scan simulated in the drawing")
    least_beams: int = Field(4, ge=1, description="beams on a drawn line from which it is visible")
    parallel_rad: float = Field(0.26, gt=0.0, description="lines with directions so near may correspond")
    near_m: float = Field(
        8.0, gt=0.0, description="drawn lines count that are drawn or observed so near to the robot"
    )
    sigma_m: float = Field(
        0.5, gt=0.0, description="sigma of f = exp(-(x - xhat)^2 / (2 sigma^2)), metres of the world"
    )
    threshold: float = Field(0.3, gt=0.0, lt=1.0, description="f above this: the line is observed")
    step_m: float = Field(0.25, gt=0.0, description="correction of the unobserved axis, metres of the world")
    patience: int = Field(3, ge=1, description="updates in a row without observation before a correction")


class HandmapSlamConfig(StrictModel):
    """SLAM with a hand-drawn map as prior."""

    name: Literal["handmap-slam"] = "handmap-slam"
    start: tuple[float, float, float] | None = Field(
        None,
        description="x, y (metres at 0.1 m a pixel from the drawing's lower-left corner), yaw (rad); absent: found",
    )
    front_end: Literal["surfaces", "lines"] = Field(
        "surfaces", description="lines: the paper's own (6.2), RANSAC and Hough lines and point-to-plane ICP"
    )
    correction: bool = Field(True, description="correct the motion in the drawing by observed lines (6.1)")
    key_distance_m: float = Field(0.25, gt=0.0, description="a scan is a key scan after this much travel")
    key_turn_rad: float = Field(0.25, gt=0.0, description="or after this much turning")
    memory_limit_mb: float = Field(1024.0, gt=0.0, description="most memory for maps")
    drawing: DrawingConfig = DrawingConfig()
    localization: LocalizationConfig = LocalizationConfig()
    search: SearchConfig = SearchConfig()
    lines: LineConfig = LineConfig()
    scan: ScanConfig = ScanConfig(max_range_m=60.0)
    odometry: OdometryConfig = OdometryConfig()
    map: MapConfig = MapConfig()
    pose_graph: PoseGraphConfig = PoseGraphConfig()
    loop_closure: LoopClosureConfig = LoopClosureConfig()
    exploration: ExplorationConfig = ExplorationConfig()
