"""Simulated drives with infrared rangers, and the errors of a run."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Odometry, Range
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.association import associate
from gridslam.evaluation.map_errors import wall_distances
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import RunResult
from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.method import IrScanLocalizer, IrScanMapper
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.extrinsics import planar
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import WorldConfig, load_world

Floats = NDArray[np.float64]

BEARING_STEP_RAD = np.radians(0.1)


@dataclass(frozen=True, slots=True)
class InfraredDrive:
    """The events of a drive, the true path, the true map, and this map without the walls beyond the range of the sensors."""

    world: WorldConfig
    events: list[Event]
    truth: Trajectory
    walls: OccupancyGrid
    walls_in_range: OccupancyGrid


def drive(world_name: str, seed: int) -> InfraredDrive:
    """Simulate the route of a world with a seed."""
    world, path = load_world(world_name, seed=seed)
    simulator = Simulator(world, path.parent)
    events: list[Event] = []
    true: list[Odometry] = []
    for event, is_truth in drive_route(simulator):
        if is_truth and isinstance(event, Odometry):
            true.append(event)
        else:
            events.append(event)
    events.sort(key=lambda event: event.stamp_ns)
    truth = Trajectory(np.array([p.stamp_ns for p in true]), np.array([p.pose for p in true]))
    walls = true_map(simulator.scene, world.truth)
    return InfraredDrive(world, events, truth, walls, in_range(simulator.scene, world, walls, truth, events))


def in_range(
    scene: Scene, world: WorldConfig, walls: OccupancyGrid, truth: Trajectory, events: list[Event]
) -> OccupancyGrid:
    """The true map without the walls that no ranger could measure.

    A wall cell is in range if a beam without noise, from the robot's true pose at some stop, meets it strictly inside the valid
    range of the ranger. Bearings are 0.1 degrees apart and cover the servo's sweep.
    """
    stops = np.array(sorted({e.stamp_ns for e in events if isinstance(e, Range)}))
    first = np.r_[True, np.diff(stops) > 500_000_000]
    poses, _ = truth.at(stops[first] + 1_000_000_000)
    measured = np.zeros(walls.probability.shape, bool)
    for pose in poses:
        for ranger in world.sensors.infrared:
            sensor = se2.compose(pose, planar(ranger.extrinsics))
            sweep = (
                np.arange(np.radians(ranger.from_deg), np.radians(ranger.to_deg), BEARING_STEP_RAD)
                + sensor[2]
            )
            rays = np.column_stack([np.tile(sensor[:2], (len(sweep), 1)), np.cos(sweep), np.sin(sweep)])
            ranges = scene.cast(rays, ranger.range_max_m + 0.1, 0.0).ranges_m
            valid = (ranges > ranger.range_min_m) & (ranges < ranger.range_max_m)
            row, col = walls.geometry.cells(rays[valid, :2] + ranges[valid, None] * rays[valid, 2:]).T
            measured[row, col] = True
    values = walls.probability.copy()
    values[(values > 0.5) & ~measured] = np.nan
    return OccupancyGrid(values, walls.geometry)


@dataclass(frozen=True, slots=True)
class DriveScores:
    """Errors (m): absolute with a known start, and `aligned` after the best rigid alignment of the path with the true one.

    `clearance_m` is the distance from the robot's rim to the nearest wall of its own map.
    """

    accuracy: Floats
    aligned_accuracy: Floats
    completeness: Floats
    final_m: float
    aligned_final_m: float
    clearance_m: float
    process_s: float
    result: RunResult

    @property
    def figures(self) -> tuple[float, float, float, float]:
        """Mean, variance and maximum of the map's error, and p95 of completeness."""
        a = self.accuracy
        return float(a.mean()), float(a.var()), float(a.max()), float(np.percentile(self.completeness, 95))


def mapped(ride: InfraredDrive, config: IrScanConfig, seed: int = 0) -> DriveScores:
    """Map a drive and compare with the truth, with a known start and without alignment."""
    first = np.zeros(3) if config.start is None else np.array(config.start)
    start = se2.compose(ride.truth.poses[0], se2.inverse(first))  # T_truth_map
    method = IrScanMapper(config, seed)
    started = time.process_time()
    for event in ride.events:
        method.process(event)
    result = method.result()
    process_s = time.process_time() - started
    occupancy = result.occupancy
    assert occupancy is not None
    accuracy = wall_distances(occupancy, ride.walls, start).accuracy
    aligned = alignment_of(result.trajectory, ride.truth)
    completeness = wall_distances(occupancy, ride.walls_in_range, start).completeness
    return DriveScores(
        accuracy,
        wall_distances(occupancy, ride.walls, aligned).accuracy,
        completeness,
        final_error(result.trajectory, ride.truth, start),
        final_error(result.trajectory, ride.truth, aligned),
        clearance(occupancy, result.trajectory, ride.world.robot.radius_m),
        process_s,
        result,
    )


def alignment_of(found: Trajectory, truth: Trajectory) -> Floats:
    """T_truth_map `(3,)` by least squares over the positions of the path."""
    pairs = associate(found, truth.sorted(), "nearest", 10_000_000)
    alignment = find_alignment(pairs.estimate, pairs.truth, "se2", False)
    assert alignment is not None
    return alignment.T_truth_estimate


def localized(ride: InfraredDrive, config: IrScanConfig, seed: int = 0) -> float:
    """Final position error (m) of a drive that is localized on the true map; the config has the start in that map."""
    method = IrScanLocalizer(config, seed, ride.walls)
    for event in ride.events:
        method.process(event)
    return final_error(method.result().trajectory, ride.truth, np.zeros(3))


def final_error(found: Trajectory, truth: Trajectory, T_truth_map: Floats) -> float:
    """Distance (m) of the last pose from the true one."""
    last = se2.compose(T_truth_map, found.poses[-1])
    true, _ = truth.at(found.stamps_ns[-1:])
    return float(np.hypot(*(last - true[0])[:2]))


def clearance(occupancy: OccupancyGrid, path: Trajectory, radius_m: float) -> float:
    """Smallest distance (m) between the robot's rim on its path and the rim of an occupied cell; negative: a collision."""
    walls = occupancy.geometry.centres(np.argwhere(occupancy.probability > 0.5))
    tree = cKDTree(walls)
    half = 0.5 * occupancy.geometry.resolution_m
    smallest = np.inf
    for pose, near in zip(path.poses, tree.query_ball_point(path.poses[:, :2], radius_m + 0.3), strict=True):
        if near:
            offset = np.maximum(np.abs(walls[near] - pose[:2]) - half, 0.0)
            smallest = min(smallest, float(np.hypot(*offset.T).min()))
    return smallest - radius_m if np.isfinite(smallest) else 0.3
