"""The settings of `stereo-bayes`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import StrictModel


class DisparityConfig(StrictModel):
    """From image pairs to disparities; a disparity stream of the log is used unchanged."""

    disparities: int = Field(
        64,
        ge=16,
        le=512,
        multiple_of=16,
        description="Largest disparity searched for, px, 16 to 512. Higher values measure nearer obstacles and cost time.",
    )


class ObservationConfig(StrictModel):
    """From disparities to one measurement per ray, the observation o of eq. 2."""

    low_m: float = Field(0.15, description="Height above the floor, m, below which points are floor.")
    high_m: float = Field(1.8, description="Height above the floor, m, above which points are ceiling.")
    sigma_px: float = Field(
        0.6,
        gt=0.0,
        description="Standard deviation of a disparity, px. Higher values blur the map along the rays.",
    )


class CorrelationConfig(StrictModel):
    """The correlation of neighbouring cells (paper section 2.3, eqs. 7 and 8)."""

    r0: float = Field(
        0.978,
        ge=0.0,
        lt=1.0,
        description="Correlation of cells 5 cm apart, 0 to 1. Near 1 for large obstacles; 0 for independent cells.",
    )


class MotionSourceConfig(StrictModel):
    """The motion in the pose filter (paper section 1)."""

    motion: Literal["auto", "odometry", "visual"] = Field(
        "auto", description="Source of the motion; auto: odometry if the log has it, else visual odometry."
    )


class AdvancedDisparity(StrictModel):
    """The matcher of image pairs."""

    matcher: Literal["sgbm", "bm"] = Field(
        "sgbm", description="OpenCV's semi-global matching, or the faster block matching."
    )


class AdvancedObservation(StrictModel):
    """Details of the measurement per ray."""

    pick: Literal["nearest", "dominant"] = Field(
        "nearest",
        description="Which disparity of a bin counts: nearest: the largest that fills min_height_m; dominant: the most "
        "frequent, as in the paper.",
    )
    min_height_m: float = Field(
        0.12,
        gt=0.0,
        description="Smallest height of an obstacle, m. Higher values ignore more false matches.",
    )
    p_none: float = Field(
        0.1, gt=0.0, lt=1.0, description="Probability that an obstacle is not matched, 0 to 1."
    )
    p_false: float = Field(0.05, gt=0.0, lt=1.0, description="Probability of a false match, 0 to 1.")


class AdvancedCorrelation(StrictModel):
    """Extensions beyond the paper. mode fixed, behind each_frame and across_rays 0 are the paper's."""

    mode: Literal["fixed", "adaptive"] = Field(
        "fixed", description="adaptive: estimate r0 from the map while it grows; fixed: use r0."
    )
    behind: Literal["each_frame", "once"] = Field(
        "each_frame",
        description="What is expected behind a surface counts with every frame, as in the paper, or only once.",
    )
    behind_m: float = Field(
        0.2,
        ge=0.0,
        description="behind once: distance behind a surface, m, at which cells count as hidden; nearer ones may belong "
        "to the surface.",
    )
    across_rays: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="Strength of the coupling between neighbouring rays, from 0 (none) to 1 (as r0 implies).",
    )


class AdvancedMap(StrictModel):
    """Which cells of the map count as known."""

    min_visibility: float = Field(
        0.3,
        gt=0.0,
        le=1.0,
        description="Cells are unknown if no ray reached them with this probability, 0 to 1. Higher values leave more "
        "cells unknown.",
    )
    surface_m: float = Field(
        0.12, gt=0.0, description="Thickness of obstacles in the map, m; cells farther behind are unknown."
    )


class AdvancedPose(StrictModel):
    """Noise of odometry, and the averaging over the pose (section 2.4)."""

    translation_std_m: float = Field(
        0.04,
        ge=0.0,
        description="Standard deviation of odometry after 1 m, m; grows with the root of the distance.",
    )
    rotation_std_rad: float = Field(
        0.06,
        ge=0.0,
        description="Standard deviation of the yaw after 1 rad, rad; grows with the root of the rotation.",
    )
    rotation_std_per_m_rad: float = Field(
        0.04,
        ge=0.0,
        description="Standard deviation of the yaw after 1 m, rad; grows with the root of the distance.",
    )
    blur: bool = Field(
        True, description="Average the likelihoods over the pose's distribution; false uses its mean."
    )


class StereoBayesAdvancedConfig(StrictModel):
    """Settings that rarely need a change."""

    disparity: AdvancedDisparity = AdvancedDisparity()
    observation: AdvancedObservation = AdvancedObservation()
    correlation: AdvancedCorrelation = AdvancedCorrelation()
    map: AdvancedMap = AdvancedMap()
    pose: AdvancedPose = AdvancedPose()


class StereoBayesConfig(StrictModel):
    """Occupancy mapping from a stereo head."""

    name: Literal["stereo-bayes"] = "stereo-bayes"
    likelihood: Literal["chain", "occlusion", "independent"] = Field(
        "chain",
        description="chain: correlated cells that occlude each other, the paper's proposal; occlusion: independent cells "
        "that occlude each other; independent: the conventional model.",
    )
    resolution_m: float = Field(
        0.05, gt=0.0, description="Size of a map cell, m. Higher values are faster and coarser."
    )
    max_range_m: float = Field(10.0, gt=0.0, description="Length of a ray, m. Higher values cost time.")
    min_range_m: float = Field(0.3, ge=0.0, description="Range at which a ray starts, m.")
    prior: float = Field(
        0.3, gt=0.0, lt=1.0, description="Probability of occupancy of an unknown cell, 0 to 1."
    )
    frame_weight: float = Field(
        1.0,
        gt=0.0,
        le=1.0,
        description="Power of the likelihoods of a frame, 0 to 1. Lower values where the errors of successive frames are "
        "alike; the map then changes more slowly.",
    )
    robot_radius_m: float = Field(
        0.2,
        gt=0.0,
        description="Radius of the robot, m; passages too narrow for it are closed in obstacles.csv.",
    )
    camera: str = Field(
        "", description="Name of the left camera if the log has several; empty: the only one."
    )
    memory_limit_mb: float = Field(
        512.0, gt=0.0, description="Memory of the map, MB, at which the run ends with an error."
    )
    disparity: DisparityConfig = DisparityConfig()
    observation: ObservationConfig = ObservationConfig()
    correlation: CorrelationConfig = CorrelationConfig()
    pose: MotionSourceConfig = MotionSourceConfig()
    advanced: StereoBayesAdvancedConfig = StereoBayesAdvancedConfig()
