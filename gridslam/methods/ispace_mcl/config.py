"""The settings of `ispace-mcl`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import NotNegative, StrictModel

LidarWeightName = Literal["likelihood-field", "beam", "range-difference"]
CameraWeightName = Literal["detection", "density", "density-as-printed"]


class ParticleCountConfig(StrictModel):
    """Bounds of the number of particles; KLD sampling chooses the number between them."""

    min: int = Field(
        1000,
        ge=10,
        description="Smallest number of particles. Raise it to follow more hypotheses; it costs time.",
    )
    max: int = Field(
        10_000,
        ge=10,
        description="Largest number of particles, also the number at the start. Raise it for large maps; it costs time.",
    )


class OdometryNoiseConfig(StrictModel):
    """Variances of the odometry per squared motion (Thrun et al. 2005, table 5.6)."""

    alpha1: float = Field(
        0.1,
        ge=0.0,
        description="Rotation noise caused by rotation, in rad^2/rad^2. Raise it when headings drift in turns.",
    )
    alpha2: float = Field(
        0.01,
        ge=0.0,
        description="Rotation noise caused by translation, in rad^2/m^2. Raise it when headings drift on straight "
        "drives.",
    )
    alpha3: float = Field(
        0.03,
        ge=0.0,
        description="Translation noise caused by translation, in m^2/m^2. Raise it when distances are wrong.",
    )
    alpha4: float = Field(
        0.005,
        ge=0.0,
        description="Translation noise caused by rotation, in m^2/rad^2. Raise it when the robot shifts while it turns.",
    )


class LocalizationScanConfig(StrictModel):
    """The readings of a scan that are used."""

    beams: int = Field(
        60,
        ge=3,
        description="Largest number of beams that weight the particles, evenly from the scan. Raise it for a more "
        "accurate pose; it costs time.",
    )
    max_range_m: float = Field(
        30.0,
        gt=0.0,
        description="Range in metres beyond which readings count as no return, even if the sensor's range_max is "
        "larger. Lower it for a lidar that is unreliable far away.",
    )


class GlobalSearchConfig(StrictModel):
    """The search of the whole map for the poses that explain the last scans."""

    enabled: bool = Field(
        True,
        description="Whether the whole map is searched at the start, while lost, and now and then. Off: without `start` "
        "particles begin uniformly over free space, and a lost robot is not found again.",
    )


class FixedCamerasConfig(StrictModel):
    """RGB-D cameras that are fixed in the room."""

    enabled: bool = Field(
        True,
        description="Whether the fixed cameras of the log are used. Off: the onboard sensor alone.",
    )


class AdvancedLocalizationConfig(StrictModel):
    """Settings that few logs need."""

    min_range_m: float = Field(
        0.1,
        ge=0.0,
        description="Range in metres below which readings are dropped. Raise it if the sensor sees the robot itself.",
    )
    occupied_threshold: float = Field(
        0.65,
        gt=0.0,
        lt=1.0,
        description="Smallest occupancy probability at which a map cell is a wall. Raise it if doubtful cells of the "
        "map are taken for walls.",
    )
    free_threshold: float = Field(
        0.3,
        gt=0.0,
        lt=1.0,
        description="Largest occupancy probability at which the robot may stand in a map cell. Lower it to keep "
        "particles off doubtful cells.",
    )
    resample_below: float = Field(
        0.5,
        gt=0.0,
        le=1.0,
        description="Fraction of the particles; when the effective sample size falls below it, they are resampled. "
        "Raise it to resample more often, which loses hypotheses; 1: after every scan.",
    )
    slip_fraction: float = Field(
        0.05,
        ge=0.0,
        le=1.0,
        description="Fraction of the particles that move with three times the odometry noise. Raise it for wheels that "
        "slip.",
    )
    max_speed_mps: float = Field(
        5.0,
        gt=0.0,
        description="Speed in m/s above which odometry has jumped; its frame then starts anew. Raise it for a faster "
        "robot.",
    )
    update_distance_m: float = Field(
        0.2,
        ge=0.0,
        description="Travel in metres after which a scan weights the particles again. Lower it to use more scans; it "
        "costs time.",
    )
    update_angle_rad: float = Field(
        0.15,
        ge=0.0,
        description="Rotation in rad after which a scan weights the particles again. Lower it to use more scans; it "
        "costs time.",
    )
    min_inlier_ratio: float = Field(
        0.55,
        ge=0.0,
        le=1.0,
        description="Ratio of beams that agree with the map at which the confidence is 0. Lower it for maps that differ "
        "from the place.",
    )
    good_inlier_ratio: float = Field(
        0.8,
        gt=0.0,
        le=1.0,
        description="Ratio of beams that agree with the map at which the confidence is full. Lower it for maps that "
        "differ from the place.",
    )
    depth_min_height_m: float = Field(
        0.1,
        ge=-100.0,
        le=100.0,
        description="Lowest height above the floor, in metres, at which depths of the onboard camera count as walls; used in "
        "logs without a lidar. Raise it if the floor appears as walls.",
    )
    depth_max_height_m: float = Field(
        1.0,
        gt=0.0,
        le=100.0,
        description="Largest height above the floor, in metres, at which onboard depths count as walls. Lower it if "
        "things above the map's walls appear as walls.",
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
        description="Background subtraction that finds moving objects. colour-and-depth: pixels that differ in colour and are "
        "nearer than the background. colour: the paper's, which takes lights and shadows for objects.",
    )


class IspaceMclConfig(StrictModel):
    """Monte Carlo localization on a given map, with fixed cameras where the log has any."""

    name: Literal["ispace-mcl"] = "ispace-mcl"
    start: tuple[float, float, float] | None = Field(
        None,
        description="Pose of the robot at the first scan in the map frame: x (m), y (m), yaw (rad). Absent: anywhere.",
    )
    start_std: tuple[NotNegative, NotNegative, NotNegative] = Field(
        (0.3, 0.3, 0.15),
        description="Standard deviations of `start`: x (m), y (m), yaw (rad). Raise them to search a larger area.",
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
