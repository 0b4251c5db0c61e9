"""The robot's pose and map in metres (paper section 6.2): tracking scan by scan, loops closed over the whole log at the end.

The tracking and the final stage are those of the lidar SLAM in `slam_sd`, without its particles: the drawing, not a
filter over maps, tells where the robot is on the large scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.final_stage import Refined, refine
from gridslam.methods.slam_sd.front_end import FrontEnd
from gridslam.methods.slam_sd.grid_map import draw_map
from gridslam.methods.slam_sd.scans import PreparedScan
from gridslam.methods.slam_sd.track import spread_corrections

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Finished:
    """All scans' poses `(n, 3)`, the key scans' poses `(k, 3)`, the map, and what the final stage did."""

    poses: Floats
    key_poses: Floats
    occupancy: OccupancyGrid
    refined: Refined | None


def surface_front_end(config: HandmapSlamConfig) -> FrontEnd:
    """Tracking against a local map of surfaces."""
    return FrontEnd(config.surfaces, config.odometry, config.memory_limit_mb)


def finish_map(
    config: HandmapSlamConfig, scans: Sequence[PreparedScan], track: Floats, keys: NDArray[np.int64]
) -> Finished:
    """Close the loops over the track `(n, 3)` (if the final stage is enabled) and draw the key scans.

    Raises MethodError when the map would exceed the memory limit.
    """
    settings = as_lidar_slam(config)
    key_poses = track[keys]
    refined = None
    resolution = config.map.resolution_m
    if config.final_stage.enabled:
        refined = refine(scans, key_poses, key_poses, settings)
        key_poses = np.asarray(se2.compose(track[keys[0]], se2.between(refined.poses[0], refined.poses)))
        resolution = config.final_stage.resolution_m or resolution
    occupancy = draw_map(scans, key_poses, resolution, config.map, config.memory_limit_mb)
    return Finished(spread_corrections(track, keys, key_poses), key_poses, occupancy, refined)


def as_lidar_slam(config: HandmapSlamConfig) -> SlamSdConfig:
    """The same settings as the lidar SLAM names them."""
    return SlamSdConfig(
        memory_limit_mb=config.memory_limit_mb,
        key_distance_m=config.key_distance_m,
        key_turn_rad=config.key_turn_rad,
        scan=config.scan,
        odometry=config.odometry,
        front_end=config.surfaces,
        map=config.map,
        final_stage=config.final_stage,
    )
