"""The settings of `stereo-bayes`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from gridslam.config.base import StrictModel


class DisparityConfig(StrictModel):
    """From image pairs to disparities; a log's own disparity stream is used as it is."""

    matcher: Literal["sgbm", "bm"] = Field("sgbm", description="OpenCV's semi-global or block matching")
    disparities: int = Field(
        64, ge=16, le=512, multiple_of=16, description="largest disparity searched for, px"
    )
    block_px: int = Field(5, ge=1, le=31, description="side of the matched block; odd")
    uniqueness: int = Field(10, ge=0, le=100, description="margin in percent over the second best match")
    speckle_px: int = Field(100, ge=0, description="smaller islands of disparity are removed")

    @model_validator(mode="after")
    def _odd(self) -> DisparityConfig:
        if self.block_px % 2 == 0:
            raise ValueError(f"block_px must be odd, got {self.block_px}")
        return self


class ObservationConfig(StrictModel):
    """From disparities to one measurement per ray, the observation o of eq. 2."""

    bin_px: int = Field(4, ge=1, description="columns that are one ray")
    low_m: float = Field(0.15, description="what is lower is floor")
    high_m: float = Field(1.8, description="what is higher is ceiling")
    pick: Literal["nearest", "dominant"] = Field(
        "nearest",
        description="of several disparities in a bin: the largest that is tall enough, or the most frequent",
    )
    least_height_m: float = Field(0.12, gt=0.0, description="an obstacle is at least this tall")
    least_share: float = Field(
        0.25,
        ge=0.0,
        le=1.0,
        description="bins with less matched pixels tell nothing, not even that nothing is there",
    )
    sigma_px: float = Field(0.6, gt=0.0, description="standard deviation of a disparity")
    p_none: float = Field(0.1, gt=0.0, lt=1.0, description="probability that an obstacle is not matched")
    p_false: float = Field(0.05, gt=0.0, lt=1.0, description="probability of a false match")


class CorrelationConfig(StrictModel):
    """How neighbouring cells belong together (paper section 2.3, eqs. 7 and 8)."""

    mode: Literal["fixed", "adaptive"] = Field(
        "fixed", description="adaptive: estimated anew from the map as it grows"
    )
    r0: float = Field(0.978, ge=0.0, lt=1.0, description="correlation of cells at `distance_m`")
    distance_m: float = Field(0.05, gt=0.0, description="the distance that r0 belongs to")
    behind: Literal["once", "each_frame"] = Field(
        "each_frame",
        description="each_frame: as the paper's; once: what is expected behind a surface grows no surer with every frame",
    )
    behind_m: float = Field(
        0.2,
        ge=0.0,
        description="with `once`: what lies so far behind the surface is hidden; nearer, it may be the surface",
    )
    across_rays: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="how much neighbouring rays tell each other: 0 nothing, 1 as much as r0 allows",
    )


class PoseConfig(StrictModel):
    """The Kalman filter of the pose (paper section 1), and what its uncertainty does to the map (2.4)."""

    motion: Literal["auto", "odometry", "visual"] = Field(
        "auto", description="auto: odometry where the log has it, else visual odometry"
    )
    translation_m: float = Field(
        0.04, ge=0.0, description="deviation of the motion after a metre, m; grows with the root"
    )
    rotation_rad: float = Field(0.06, ge=0.0, description="deviation of a turn after a radian, rad")
    rotation_per_m_rad: float = Field(0.04, ge=0.0, description="deviation of the heading after a metre, rad")
    visual_translation_m: float = Field(0.02, ge=0.0, description="the same of visual odometry")
    visual_rotation_rad: float = Field(0.01, ge=0.0, description="the same of visual odometry")
    visual_rotation_per_m_rad: float = Field(0.003, ge=0.0, description="the same of visual odometry")
    gate: float = Field(
        11.345, gt=0.0, description="largest squared Mahalanobis distance of a fix (chi-square 0.99, 3 dof)"
    )
    window_s: float = Field(
        10.0, gt=0.0, description="fixes that come later than this after their stamp are refused"
    )
    reset_after: int = Field(
        10,
        ge=1,
        description="so many refused fixes in a row that agree with each other mean that the filter is wrong",
    )
    max_speed_mps: float = Field(30.0, gt=0.0, description="odometry that moves faster has jumped")
    blur: bool = Field(True, description="average the likelihoods over the pose's distribution")


class StereoBayesConfig(StrictModel):
    """Occupancy mapping from a stereo head."""

    name: Literal["stereo-bayes"] = "stereo-bayes"
    likelihood: Literal["chain", "occlusion", "independent"] = Field(
        "chain",
        description="the paper's proposal; independent cells that hide one another; all cells in front empty",
    )
    resolution_m: float = Field(0.05, gt=0.0, description="size of a cell")
    max_range_m: float = Field(10.0, gt=0.0, description="how far a ray is followed")
    min_range_m: float = Field(0.3, ge=0.0, description="from where on a ray is followed")
    prior: float = Field(0.3, gt=0.0, lt=1.0, description="probability of a cell that nothing is known about")
    least_probability: float = Field(
        1e-3, gt=0.0, lt=0.5, description="no cell becomes surer than this, so that it can change its mind"
    )
    frame_weight: float = Field(
        1.0,
        gt=0.0,
        le=1.0,
        description="power of a frame's likelihoods: errors of successive frames are alike",
    )
    seen_from: float = Field(
        0.3,
        gt=0.0,
        le=1.0,
        description="cells to which a ray came with less probability are unknown in the map",
    )
    surface_m: float = Field(
        0.12, gt=0.0, description="obstacles are drawn so thick: what lies farther behind was not seen"
    )
    memory_limit_mb: float = Field(512.0, gt=0.0, description="the map may not need more")
    robot_radius_m: float = Field(0.2, gt=0.0, description="narrower passages between obstacles are closed")
    camera: str = Field(
        "", description="name of the left camera where the log has several; empty: the only one"
    )
    disparity: DisparityConfig = DisparityConfig()
    observation: ObservationConfig = ObservationConfig()
    correlation: CorrelationConfig = CorrelationConfig()
    pose: PoseConfig = PoseConfig()
