"""The settings of `slam-sd`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import StrictModel
from gridslam.lidar_slam.config import (
    LoopClosureConfig,
    MapConfig,
    OdometryConfig,
    PoseGraphConfig,
    ScanConfig,
)
from gridslam.methods.slam_sd.objects.object_config import ObjectEvidenceConfig, ObjectsConfig


class FilterConfig(StrictModel):
    """The Rao-Blackwellised filter over the key scans."""

    run: Literal["needed", "always"] = Field(
        "needed",
        description="When particles are used. needed: if there are tags or pose_graph.enabled is false, as loop closure "
        "does not use them otherwise. always: to see them in the report; it takes longer.",
    )
    window_key_scans: int = Field(
        60,
        ge=0,
        description="Number of later key scans after which a key scan enters the particles' maps. Raise it if particles "
        "match against what the front end has used already.",
    )
    min_inlier_ratio: float = Field(
        0.6,
        gt=0.0,
        le=1.0,
        description="Smallest fraction of points on known surfaces at which a scan counts as matched to a particle's "
        "map. Raise it where places look alike.",
    )


class SlamSdAdvancedConfig(StrictModel):
    """Settings that rarely need a change."""

    odometry: OdometryConfig = OdometryConfig()
    filter: FilterConfig = FilterConfig()
    loop_closure: LoopClosureConfig = LoopClosureConfig()
    objects: ObjectEvidenceConfig = ObjectEvidenceConfig()


class SlamSdConfig(StrictModel):
    """SLAM in semi-dynamic environments; without tag reads a lidar SLAM."""

    name: Literal["slam-sd"] = "slam-sd"
    particles: int = Field(
        30,
        ge=1,
        le=1000,
        description="Number of particles. Raise it where loops are long and places look alike; time and memory grow "
        "with it.",
    )
    key_distance_m: float = Field(
        0.25,
        gt=0.0,
        description="Travel in metres after which a scan becomes a key scan. Raise it to save time and memory.",
    )
    key_rotation_rad: float = Field(
        0.25,
        gt=0.0,
        description="Rotation in rad after which a scan becomes a key scan. Raise it to save time and memory.",
    )
    memory_limit_mb: float = Field(
        1024.0,
        gt=0.0,
        description="Largest memory of the maps in MB; a run that needs more ends with an error. Raise it for large or "
        "fine maps.",
    )
    scan: ScanConfig = ScanConfig()
    map: MapConfig = MapConfig()
    pose_graph: PoseGraphConfig = PoseGraphConfig()
    objects: ObjectsConfig = ObjectsConfig()
    advanced: SlamSdAdvancedConfig = SlamSdAdvancedConfig()
