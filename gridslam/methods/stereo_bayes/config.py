"""The settings of `stereo-bayes`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import StrictModel

MAX_HEIGHT_M = 100.0  # above or below the floor; higher numbers are mistaken units


class DisparityConfig(StrictModel):
    """From image pairs to disparities; a disparity stream of the log is used unchanged."""

    disparities: int = Field(
        64,
        ge=16,
        le=512,
        multiple_of=16,
        description="Largest disparity searched for, in px. Raise it to measure nearer obstacles; it costs time.",
    )


class ObservationConfig(StrictModel):
    """From disparities to one measurement per ray, the observation o of eq. 2."""

    low_m: float = Field(
        0.15,
        ge=-MAX_HEIGHT_M,
        le=MAX_HEIGHT_M,
        description="Height above the floor, in metres, below which points are floor. Raise it if the floor appears as "
        "obstacles; lower obstacles are missed then.",
    )
    high_m: float = Field(
        1.8,
        ge=-MAX_HEIGHT_M,
        le=MAX_HEIGHT_M,
        description="Height above the floor, in metres, above which points are ceiling. Lower it if ceilings or lintels "
        "appear as obstacles.",
    )
    sigma_px: float = Field(
        0.6,
        gt=0.0,
        description="Standard deviation of a disparity, in px. Raise it for poor images; the map is then blurred along "
        "the rays.",
    )


class CorrelationConfig(StrictModel):
    """The correlation of neighbouring cells (paper section 2.3, eqs. 7 and 8)."""

    r0: float = Field(
        0.978,
        ge=0.0,
        lt=1.0,
        description="Correlation of cells 5 cm apart. Raise it (towards 1) for large obstacles; 0: independent cells.",
    )


class MotionSourceConfig(StrictModel):
    """The motion in the pose filter (paper section 1)."""

    motion: Literal["auto", "odometry", "visual"] = Field(
        "auto",
        description="Source of the motion. auto: odometry if the log has it, else visual odometry.",
    )


class AdvancedDisparity(StrictModel):
    """The matcher of image pairs."""

    matcher: Literal["sgbm", "bm"] = Field(
        "sgbm",
        description="Matcher of image pairs: OpenCV's semi-global matching (sgbm), or its faster block matching (bm).",
    )


class AdvancedObservation(StrictModel):
    """Details of the measurement per ray."""

    pick: Literal["nearest", "dominant"] = Field(
        "nearest",
        description="Disparity that is the measurement of a bin. nearest: the largest whose pixels cover min_height_m. "
        "dominant: the most frequent, as in the paper.",
    )
    min_height_m: float = Field(
        0.12,
        gt=0.0,
        description="Smallest height of an obstacle in metres. Raise it to ignore more false matches; flat obstacles "
        "are missed then.",
    )
    p_none: float = Field(
        0.1,
        gt=0.0,
        lt=1.0,
        description="Probability that an obstacle is not matched. Raise it for surfaces without texture: a ray without "
        "a match then counts less as free.",
    )
    p_false: float = Field(
        0.05,
        gt=0.0,
        lt=1.0,
        description="Probability of a false match. Raise it for repeating textures: a match then counts less as an "
        "obstacle.",
    )


class AdvancedCorrelation(StrictModel):
    """Extensions beyond the paper. mode fixed, behind each_frame and across_rays 0 are the paper's."""

    mode: Literal["fixed", "adaptive"] = Field(
        "fixed",
        description="Whether the correlation is r0 (fixed) or is estimated from the map while it grows (adaptive).",
    )
    behind: Literal["each_frame", "once"] = Field(
        "each_frame",
        description="How often the cells expected behind a surface count: with every frame, as in the paper "
        "(each_frame), or only once (once).",
    )
    behind_m: float = Field(
        0.2,
        ge=0.0,
        description="behind once: distance behind a surface, in metres, from which cells count as hidden; nearer ones "
        "may belong to the surface. Raise it where depths are inaccurate.",
    )
    across_rays: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="Strength of the coupling between neighbouring rays: from none (0) to what r0 implies (1). Raise it for "
        "smooth surfaces, whose rays then support each other.",
    )


class AdvancedMap(StrictModel):
    """Thresholds for the known cells of the map."""

    min_visibility: float = Field(
        0.3,
        gt=0.0,
        le=1.0,
        description="Smallest probability of a ray having reached a cell for the cell to be known. Raise it to leave "
        "doubtful cells unknown.",
    )
    surface_m: float = Field(
        0.12,
        gt=0.0,
        description="Thickness of obstacles in the map in metres; cells farther behind are unknown. Raise it where "
        "depths are inaccurate.",
    )


class AdvancedPose(StrictModel):
    """Noise of odometry, and the averaging over the pose (section 2.4)."""

    translation_std_m: float = Field(
        0.04,
        ge=0.0,
        description="Standard deviation of the odometry's position after 1 m, in metres; grows with the root of the "
        "distance. Raise it for wheels that slip: the map is blurred more, and absolute poses weigh more.",
    )
    rotation_std_rad: float = Field(
        0.06,
        ge=0.0,
        description="Standard deviation of the odometry's yaw after 1 rad, in rad; grows with the root of the rotation. "
        "Raise it for wheels that slip in turns: the map is blurred more, and absolute poses weigh more.",
    )
    rotation_std_per_m_rad: float = Field(
        0.04,
        ge=0.0,
        description="Standard deviation of the odometry's yaw after 1 m, in rad; grows with the root of the distance. "
        "Raise it for uneven floors: the map is blurred more, and absolute poses weigh more.",
    )
    blur: bool = Field(
        True,
        description="Whether the likelihoods are averaged over the pose's distribution; false uses its mean.",
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
        description="Likelihood of a frame. chain: correlated cells that occlude each other, the paper's proposal. "
        "occlusion: independent cells that occlude each other. independent: the conventional model.",
    )
    resolution_m: float = Field(
        0.05,
        gt=0.0,
        description="Size of a map cell in metres. Raise it for a faster run and a coarser map.",
    )
    max_range_m: float = Field(
        10.0,
        gt=0.0,
        description="Length of a ray in metres. Raise it to map farther obstacles; it costs time.",
    )
    min_range_m: float = Field(
        0.3,
        ge=0.0,
        description="Range in metres at which a ray starts. Raise it if the robot's own parts appear in the map.",
    )
    prior: float = Field(
        0.3,
        gt=0.0,
        lt=1.0,
        description="Probability that an unknown cell is occupied. Lower it where most of the space is free: obstacles "
        "then need more evidence.",
    )
    frame_weight: float = Field(
        1.0,
        gt=0.0,
        le=1.0,
        description="Exponent of the likelihoods of a frame. Lower it where the errors of successive frames are alike; "
        "the map then changes more slowly.",
    )
    robot_radius_m: float = Field(
        0.2,
        gt=0.0,
        description="Radius of the robot in metres; passages too narrow for it are closed in obstacles.csv. Raise it to "
        "close wider passages.",
    )
    camera: str = Field(
        "",
        description="Name of the left camera if the log has several; empty: the only one.",
    )
    memory_limit_mb: float = Field(
        512.0,
        gt=0.0,
        description="Largest memory of the map in MB; a run that needs more ends with an error. Raise it for large or "
        "fine maps.",
    )
    disparity: DisparityConfig = DisparityConfig()
    observation: ObservationConfig = ObservationConfig()
    correlation: CorrelationConfig = CorrelationConfig()
    pose: MotionSourceConfig = MotionSourceConfig()
    advanced: StereoBayesAdvancedConfig = StereoBayesAdvancedConfig()
