"""The settings of `slam-sd`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gridslam.config.base import StrictModel
from gridslam.lidar_slam.config import (
    FinalStageConfig,
    FrontEndConfig,
    MapConfig,
    OdometryConfig,
    ScanConfig,
)
from gridslam.methods.slam_sd.object_config import ObjectsConfig


class FilterConfig(StrictModel):
    """The Rao-Blackwellised filter over the key scans."""

    resolution_m: float = Field(0.2, gt=0.0, description="cell of a particle's surface map")
    free_resolution_m: float = Field(0.2, gt=0.0, description="cell of a particle's log-odds map")
    window_key_scans: int = Field(
        60, ge=0, description="a key scan enters the particles' maps after so many more"
    )
    max_points: int = Field(80, ge=20, description="most points of a key scan used by a particle")
    translation_floor_m: float = Field(
        0.0015, gt=0.0, description="noise of the matched motion over one key step"
    )
    translation_per_m: float = Field(0.005, ge=0.0)
    rotation_floor_rad: float = Field(0.001, gt=0.0)
    rotation_per_rad: float = Field(0.01, ge=0.0)
    sigma_m: float = Field(0.06, gt=0.0, description="standard deviation of an end point about a surface")
    reach_m: float = Field(0.3, gt=0.0, description="farthest correspondence")
    least_fit: float = Field(
        0.6, gt=0.0, le=1.0, description="share of points on known surfaces that ties a scan to the map"
    )
    least_search_fit: float = Field(0.6, gt=0.0, le=1.0, description="the same after a search")
    search_after: int = Field(
        20, ge=0, description="untied for so many key scans, a particle looks around for its map"
    )
    search_m: float = Field(0.5, ge=0.0, description="within this deviation at least")
    search_rad: float = Field(0.05, ge=0.0, description="and this deviation of the heading")
    search_gain: float = Field(0.3, description="and find a log likelihood higher by so much for each point")
    search_every: int = Field(3, ge=1, description="and does so at every so many key scans")
    search_starts: int = Field(6, ge=0, description="from so many poses drawn from its drift")
    anchored_m: float = Field(
        0.1, gt=0.0, description="a scan that ties the position to this anchors the path"
    )
    bend_from_m: float = Field(0.03, gt=0.0, description="smaller corrections move the last pose only")
    bend_from_rad: float = Field(0.01, gt=0.0, description="smaller corrections turn the last pose only")
    rebuild_from_m: float = Field(
        0.1, gt=0.0, description="a path that moves its scans farther has its map drawn anew"
    )
    scan_information_share: float = Field(
        0.05,
        gt=0.0,
        le=1.0,
        description="share of a scan's information that counts (its beams are not independent)",
    )
    random_share: float = Field(0.1, gt=0.0, lt=1.0, description="share of readings that no surface explains")
    likelihood_share: float = Field(
        0.01, gt=0.0, le=1.0, description="power of the scan likelihood in a particle's weight"
    )
    most_evidence: float = Field(1.0, gt=0.0, description="most that one scan takes from a log weight")
    resample_below: float = Field(
        0.5, gt=0.0, le=1.0, description="resample when N_eff falls below this share"
    )


class SlamSdConfig(StrictModel):
    """SLAM in semi-dynamic environments; without tag reads a lidar SLAM."""

    name: Literal["slam-sd"] = "slam-sd"
    particles: int = Field(30, ge=1, le=1000, description="number of particles")
    key_distance_m: float = Field(0.25, gt=0.0, description="a scan is a key scan after this much travel")
    key_turn_rad: float = Field(0.25, gt=0.0, description="or after this much turning")
    memory_limit_mb: float = Field(1024.0, gt=0.0, description="most memory for the particles' maps")
    scan: ScanConfig = ScanConfig()
    odometry: OdometryConfig = OdometryConfig()
    front_end: FrontEndConfig = FrontEndConfig()
    filter: FilterConfig = FilterConfig()
    map: MapConfig = MapConfig()
    final_stage: FinalStageConfig = FinalStageConfig()
    objects: ObjectsConfig = ObjectsConfig()
