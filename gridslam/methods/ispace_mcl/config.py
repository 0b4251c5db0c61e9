"""The settings of `ispace-mcl`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import StrictModel

LidarWeightName = Literal["likelihood-field", "beam", "range-difference"]
CameraWeightName = Literal["detection", "density", "density-as-printed"]


class ParticleCountConfig(StrictModel):
    """Bounds of the number of particles; KLD sampling chooses the number between them."""

    min: int = Field(
        1000,
        ge=10,
        description="Smallest number of particles. A higher number follows more hypotheses, at more time.",
    )
    max: int = Field(
        10_000,
        ge=10,
        description="Largest number of particles, also the number at the start. A higher number helps on large maps.",
    )


class OdometryNoiseConfig(StrictModel):
    """Variances of the odometry per squared motion (Thrun et al. 2005, table 5.6)."""

    alpha1: float = Field(
        0.1,
        ge=0.0,
        description="Rotation noise caused by rotation, rad^2/rad^2. Raise it when headings drift in turns.",
    )
    alpha2: float = Field(
        0.01,
        ge=0.0,
        description="Rotation noise caused by translation, rad^2/m^2. Raise it when headings drift on straight drives.",
    )
    alpha3: float = Field(
        0.03,
        ge=0.0,
        description="Translation noise caused by translation, m^2/m^2. Raise it when distances are wrong.",
    )
    alpha4: float = Field(
        0.005,
        ge=0.0,
        description="Translation noise caused by rotation, m^2/rad^2. Raise it when the robot shifts while it turns.",
    )


class LocalizationScanConfig(StrictModel):
    """The readings of a scan that are used."""

    beams: int = Field(
        60,
        ge=3,
        description="Largest number of beams that weight the particles, evenly from the scan. More beams cost more time.",
    )
    max_range_m: float = Field(
        30.0,
        gt=0.0,
        description="Readings beyond this range (m) count as no return, even if the sensor's range_max is larger.",
    )


class GlobalSearchConfig(StrictModel):
    """The search of the whole map for the poses that explain the last scans."""

    enabled: bool = Field(
        True,
        description="Search the whole map at the start, while lost, and now and then. Off: without `start` particles begin "
        "uniformly over free space, and a lost robot is not found again.",
    )


class FixedCamerasConfig(StrictModel):
    """RGB-D cameras that are fixed in the room."""

    enabled: bool = Field(
        True, description="Use the fixed cameras of the log. Off: the onboard sensor alone."
    )


class AdvancedLocalizationConfig(StrictModel):
    """Settings that few logs need."""

    min_range_m: float = Field(
        0.1, ge=0.0, description="Readings below this range (m) are dropped: they show the robot itself."
    )
    occupied_threshold: float = Field(
        0.65, gt=0.0, lt=1.0, description="Smallest occupancy probability at which a map cell is a wall."
    )
    free_threshold: float = Field(
        0.3,
        gt=0.0,
        lt=1.0,
        description="Largest occupancy probability at which the robot may stand in a map cell.",
    )
    resample_below: float = Field(
        0.5,
        gt=0.0,
        le=1.0,
        description="Resample when the effective sample size falls below this fraction of the particles. 1: after every scan.",
    )
    slip_fraction: float = Field(
        0.05,
        ge=0.0,
        le=1.0,
        description="Fraction of the particles that move with three times the odometry noise. Raise it for wheels that slip.",
    )
    max_speed_mps: float = Field(
        5.0,
        gt=0.0,
        description="Odometry that moves faster than this (m/s) has jumped; its frame then starts anew.",
    )
    update_distance_m: float = Field(
        0.2,
        ge=0.0,
        description="Travel (m) after which a scan weights the particles again. Lower values cost more time.",
    )
    update_angle_rad: float = Field(
        0.15, ge=0.0, description="Rotation (rad) after which a scan weights the particles again."
    )
    min_inlier_ratio: float = Field(
        0.55,
        ge=0.0,
        le=1.0,
        description="Ratio of beams that agree with the map at which the confidence is 0. Lower it for maps that differ from "
        "the place.",
    )
    good_inlier_ratio: float = Field(
        0.8,
        gt=0.0,
        le=1.0,
        description="Ratio of beams that agree with the map at which the confidence is full. Lower it for maps that differ "
        "from the place.",
    )
    depth_min_height_m: float = Field(
        0.1,
        description="In a log without a lidar, the onboard depth camera replaces it: lowest height (m) above the floor at which "
        "depths count as walls.",
    )
    depth_max_height_m: float = Field(
        1.0, gt=0.0, description="Largest height (m) above the floor at which onboard depths count as walls."
    )
    camera_root_frame: str = Field(
        "map",
        min_length=1,
        description="Parent frame of the fixed cameras' static transforms; it coincides with the map's frame.",
    )
    camera_weight: CameraWeightName = Field(
        "detection",
        description="Weight of a pose by what fixed cameras see. detection: likelihood of detections and misses. density: the "
        "paper's product of kernel densities (eqs. 5 - 7). density-as-printed: the same with a kernel density of the particles.",
    )
    camera_background: Literal["colour-and-depth", "colour"] = Field(
        "colour-and-depth",
        description="What tells moving objects from the background. colour: the paper's background subtraction, which takes "
        "lights and shadows for objects.",
    )


class IspaceMclConfig(StrictModel):
    """Monte Carlo localization on a given map, with fixed cameras where the log has any."""

    name: Literal["ispace-mcl"] = "ispace-mcl"
    start: tuple[float, float, float] | None = Field(
        None,
        description="Pose of the robot at the first scan in the map frame: x (m), y (m), yaw (rad). Absent: anywhere.",
    )
    start_std: tuple[float, float, float] = Field(
        (0.3, 0.3, 0.15),
        description="Standard deviations of `start` in x (m), y (m) and yaw (rad). Larger values search a larger area.",
    )
    weight: LidarWeightName = Field(
        "likelihood-field",
        description="Weight of a pose by a scan. likelihood-field: distances of beam endpoints to walls, fast. beam: ray casting "
        "with a four-part mixture. range-difference: the paper's mean squared range difference (eqs. 3, 4).",
    )
    estimate: Literal["cluster", "mean"] = Field(
        "cluster",
        description="Reported pose: mean of the heaviest cluster, or as in the paper of all particles.",
    )
    particles: ParticleCountConfig = ParticleCountConfig()
    motion: OdometryNoiseConfig = OdometryNoiseConfig()
    scan: LocalizationScanConfig = LocalizationScanConfig()
    search: GlobalSearchConfig = GlobalSearchConfig()
    cameras: FixedCamerasConfig = FixedCamerasConfig()
    advanced: AdvancedLocalizationConfig = AdvancedLocalizationConfig()
