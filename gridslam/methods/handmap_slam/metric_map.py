"""The robot's pose and map in metres (paper section 6.2): tracking scan by scan, loops closed over the whole log at the end.

Tracking and loop closure are those of `lidar_slam`; the drawing, not a filter over maps, tells where the robot is on the large
scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.grid_map import draw_map
from gridslam.lidar_slam.key_scans import StepNoise, distribute_corrections
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.trajectory_optimisation import (
    OptimisedTrajectory,
    TrajectoryOptimiser,
    optimise_trajectory,
)
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.handmap_slam.config import HandmapSlamConfig

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Finished:
    """All scans' poses `(n, 3)`, the map, and the counts of the pose graph optimisation."""

    poses: Floats
    occupancy: OccupancyGrid
    optimised: OptimisedTrajectory | None


def surface_front_end(config: HandmapSlamConfig) -> FrontEnd:
    """Tracking against a local map of surfaces."""
    return FrontEnd(config.odometry, config.memory_limit_mb)


def finish_map(
    config: HandmapSlamConfig, scans: Sequence[PreparedScan], track: Floats, keys: NDArray[np.int64]
) -> Finished:
    """Close the loops over the track `(n, 3)` (if pose_graph.enabled) and draw the key scans.

    Raises MethodError when the map would exceed the memory limit.
    """
    key_poses = track[keys]
    optimised = None
    resolution = config.map.resolution_m
    if config.pose_graph.enabled:
        settings = TrajectoryOptimiser(config.loop_closure, StepNoise(), config.memory_limit_mb)
        optimised = optimise_trajectory(scans, key_poses, key_poses, settings)
        key_poses = np.asarray(se2.compose(track[keys[0]], se2.between(optimised.poses[0], optimised.poses)))
        resolution = config.pose_graph.resolution_m or resolution
    occupancy = draw_map(scans, key_poses, resolution, config.memory_limit_mb)
    return Finished(distribute_corrections(track, keys, key_poses), occupancy, optimised)
