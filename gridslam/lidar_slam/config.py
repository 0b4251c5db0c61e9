"""Settings that the lidar SLAM methods share; everything else is a constant beside the algorithm that uses it."""

from __future__ import annotations

from pydantic import Field

from gridslam.config.base import StrictModel


class ScanConfig(StrictModel):
    """Readings of a scan that are used."""

    min_range_m: float = Field(
        0.05,
        ge=0.0,
        description="Shortest range in metres that is used. Raise it to ignore parts of the robot in view.",
    )
    max_range_m: float = Field(
        40.0,
        gt=0.0,
        description="Longest range in metres that is used, if the log's range_max is not shorter. Lower it for a lidar "
        "that is unreliable far away.",
    )


class OdometryConfig(StrictModel):
    """Noise and limits of the odometry."""

    translation_per_m: float = Field(
        0.2,
        ge=0.0,
        description="Standard deviation of the odometry's translation in metres per metre travelled. Raise it for "
        "wheels that slip: scan matching then searches farther.",
    )
    rotation_per_rad: float = Field(
        0.5,
        ge=0.0,
        description="Standard deviation of the odometry's rotation in rad per rad turned. Raise it for a poor gyro: "
        "scan matching then searches a wider range of headings.",
    )
    max_speed_mps: float = Field(
        5.0,
        gt=0.0,
        description="Speed in m/s above which odometry counts as a jump of its frame. Raise it for a faster robot.",
    )
    max_yaw_rate_radps: float = Field(
        10.0,
        gt=0.0,
        description="Yaw rate in rad/s above which odometry counts as a jump of its frame. Raise it for a faster robot.",
    )


class MapConfig(StrictModel):
    """The occupancy grid."""

    resolution_m: float = Field(
        0.05,
        gt=0.0,
        description="Size of a map cell in metres. Lower it for more detail; it needs more memory.",
    )


class PoseGraphConfig(StrictModel):
    """Loop closure and pose graph optimisation over the whole trajectory, after the last scan."""

    enabled: bool = Field(
        True, description="Whether loops are closed and the trajectory is optimised after the last scan."
    )
    resolution_m: float | None = Field(
        None,
        gt=0.0,
        description="Cell size in metres of the map drawn from the optimised trajectory. Absent: map.resolution_m. "
        "Lower it for more detail; it needs more memory.",
    )


class LoopClosureConfig(StrictModel):
    """Drift of the tracked trajectory: the windows in which loops are searched for grow with it."""

    translation_drift_m: float = Field(
        0.02,
        gt=0.0,
        description="Standard deviation in metres of the tracked position after one metre of travel, growing with the "
        "square root of the travel. Raise it if loops are missed: they are searched for in wider windows, "
        "which takes longer.",
    )
    rotation_drift_rad: float = Field(
        0.003,
        gt=0.0,
        description="Standard deviation in rad of the tracked heading after one metre of travel, growing with the "
        "square root of the travel. Raise it if loops are missed: they are searched for in wider windows, "
        "which takes longer.",
    )
