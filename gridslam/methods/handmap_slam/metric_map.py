"""The robot's pose and map in metres (paper section 6.2): tracking scan by scan, loops closed over the whole log at the end.

Tracking and final stage are those of `lidar_slam`; the drawing, not a filter over maps, tells where the robot is on the large
scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.final_stage import Refined, Refinement, refine
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.grid_map import draw_map
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.track import MatchedStepNoise, spread_corrections
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.handmap_slam.config import HandmapSlamConfig

Floats = NDArray[np.float64]

SUBMAP_CELL_M = 0.2


@dataclass(frozen=True, slots=True)
class Finished:
    """All scans' poses `(n, 3)`, the map, and what the final stage did."""

    poses: Floats
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
    key_poses = track[keys]
    refined = None
    resolution = config.map.resolution_m
    if config.final_stage.enabled:
        settings = Refinement(config.final_stage, MatchedStepNoise(), SUBMAP_CELL_M, config.memory_limit_mb)
        refined = refine(scans, key_poses, key_poses, settings)
        key_poses = np.asarray(se2.compose(track[keys[0]], se2.between(refined.poses[0], refined.poses)))
        resolution = config.final_stage.resolution_m or resolution
    occupancy = draw_map(scans, key_poses, resolution, config.map, config.memory_limit_mb)
    return Finished(spread_corrections(track, keys, key_poses), occupancy, refined)
