"""The trajectory and map in metres (paper section 6.2): scan tracking, and loop closure over the whole log at the end.

Tracking and trajectory optimisation are those of `lidar_slam`. The drawing takes the place of a filter over maps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.grid_map import draw_map
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.loop_closure.trajectory import ClosedTrajectory, close_trajectory
from gridslam.lidar_slam.map_consistency.assessment import MapConsistency, assess_map
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.handmap_slam.config import HandmapSlamConfig


@dataclass(frozen=True, slots=True)
class MetricMap:
    """The trajectory over all scans, the map, its consistency, the closed loops, and loop closure itself, if that is enabled."""

    trajectory: Trajectory
    occupancy: OccupancyGrid
    consistency: MapConsistency
    loops: Edges
    optimised: ClosedTrajectory | None


def surface_front_end(config: HandmapSlamConfig) -> FrontEnd:
    """Tracking against a local map of surfaces."""
    return FrontEnd(config.advanced.odometry, config.advanced.memory_limit_mb)


def finish_map(config: HandmapSlamConfig, tracker: ScanTracker) -> MetricMap:
    """Close the loops over the tracked scans, if enabled, draw the key scans, and check them against each other.

    Raises MethodError if the map would exceed the memory limit.
    """
    key_poses = tracker.path.key_poses
    optimised = None
    resolution = config.map.resolution_m
    memory_limit_mb = config.advanced.memory_limit_mb
    drift = replace(DriftModel.of(config.advanced.loop_closure), slips=tracker.path.key_slips)
    if config.pose_graph.enabled:
        optimised = close_trajectory(tracker.key_scans, key_poses, drift=drift)
        key_poses = optimised.poses
        resolution = config.pose_graph.resolution_m or resolution
    occupancy = draw_map(tracker.key_scans, key_poses, resolution, memory_limit_mb)
    loops = Edges.none() if optimised is None else optimised.loops
    consistency = assess_map(tracker.key_scans, key_poses, tracker.path.key_poses, loops, drift)
    return MetricMap(tracker.corrected(key_poses), occupancy, consistency, loops, optimised)
