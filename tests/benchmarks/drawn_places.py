"""Drives through places of which there are drawings, and how a run over them is judged."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Odometry
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.map_errors import wall_distances
from gridslam.maps.distances import distances_to
from gridslam.maps.drawings.drawing import Drawing, drawn_map, load_drawing
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.method import HandmapSlam
from gridslam.planning.descent import Inflation, cell_costs, cost_to_go, descend_cost_to_go
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import WorldConfig, load_world, validate_world
from tests.conftest import REPOSITORY

Floats = NDArray[np.float64]

DRAWINGS = REPOSITORY / "configs" / "worlds" / "drawings"
INFLATION = Inflation(min_clearance=8.0, inflation_radius=14.0, obstacle_weight=3.0)  # cells of 5 cm
WHEELS = {
    "left_radius_error": 0.003,
    "base_error": 0.01,
    "slip_mean": 0.005,
    "slip_deviation": 0.03,
    "turn_slip": 0.02,
}
STOPS = 7  # places of a route through a sketched building

# Where the corners of hand-building (m) lie in drawings/building-distorted.png (pixels, from the top left), by eye.
LANDMARKS = """
0 0 14 282, 14 0 188 282, 0 17 11 128, 14 17 187 128, 0 8 16 213, 0 10.4 16 192, 7 17 103 126, 7 10.4 103 190, 7 8 103 213,
7 0 103 282, 18 18 217 119, 18 26 215 41, 27.5 26 292 36, 27.5 18 293 115, 21.6 18 246 119, 24 18 266 117, 14 8 191 214,
14 10.4 190 194, 2.4 8 45 213, 3.6 8 61 211, 9.6 8 136 211, 10.8 8 151 213, 2.4 10.4 45 191, 3.6 10.4 61 191,
9.6 10.4 136 191, 10.8 10.4 151 192, 21.07 10.93 244 186, 19 12.3 229 175
"""
CORRESPONDENCES = np.array([[float(v) for v in line.split()] for line in LANDMARKS.split(",")])


@dataclass(frozen=True)
class RecordedDrive:
    """The events of a drive, the true trajectory, and the true map."""

    events: tuple[Event, ...]
    truth: Trajectory
    grid: OccupancyGrid


@dataclass(frozen=True)
class JudgedPlace:
    """A run: mean distance (m) from mapped to true walls, and the poses in the drawing with the true poses at their stamps."""

    result: RunResult
    map_error_m: float
    drawn: tuple[DrawingPose, ...]
    true_poses: Floats
    cpu_per_scan_s: float

    def drawing_errors(self, expected: Floats) -> Floats:
        """Distances `(n,)` (drawing units) of the estimated positions in the drawing from the expected ones `(n, 2)`."""
        return np.hypot(*(np.array([(p.x, p.y) for p in self.drawn]) - expected).T)


def drive(world: WorldConfig, folder: Path) -> RecordedDrive:
    """Drive a world's route."""
    simulator = Simulator(world, folder)
    grid = true_map(simulator.scene, world.truth)
    events: list[Event] = []
    truth: list[Odometry] = []
    for event, is_truth in drive_route(simulator):
        if not is_truth:
            events.append(event)
        elif isinstance(event, Odometry):
            truth.append(event)
    poses = np.array([(t.x_m, t.y_m, t.yaw_rad) for t in truth])
    return RecordedDrive(
        tuple(events), Trajectory(np.array([t.stamp_ns for t in truth]), poses).sorted(), grid
    )


@lru_cache(maxsize=10)
def built_in_drive(name: str, seed: int) -> RecordedDrive:
    """The route of a world that ships with the program, with other noise."""
    world, path = load_world(name, seed=seed)
    return drive(world, path.parent)


@lru_cache(maxsize=10)
def sketched_drive(
    plan: Path, start_px: tuple[float, float], resolution_m: float, seed: int
) -> RecordedDrive:
    """A round through the place that a picture of a plan shows (walls bright), from a start in pixels from its top left."""
    rows = load_drawing(plan).levels.shape[0]
    start = (start_px[0] * resolution_m, (rows - start_px[1]) * resolution_m)
    robot: dict[str, object] = {
        "start": [*start, 0.0],
        "route": [list(start)],
        "speed_mps": 0.8,
        "wheels": WHEELS,
    }
    document: dict[str, object] = {
        "seed": seed,
        "plan": {"file": plan.name, "resolution_m": resolution_m, "walls_are": "bright"},
        "robot": robot,
        "sensors": {
            "lidar": {"rate_hz": 5, "beams": 360, "range_max_m": 50, "sweep_s": 0.1, "noise_m": 0.012},
            "odometry": {"rate_hz": 20},
        },
    }  # fmt: skip
    world = validate_world(document, plan.name)
    grid = true_map(Simulator(world, plan.parent).scene, world.truth)
    route = [[float(x), float(y)] for x, y in round_trip(grid, start)]
    return drive(validate_world({**document, "robot": {**robot, "route": route}}, plan.name), plan.parent)


def round_trip(grid: OccupancyGrid, start: tuple[float, float]) -> Floats:
    """Way points `(n, 2)` of a route to the places farthest from each other, and back to the start."""
    step, origin = grid.geometry.resolution_m, np.asarray(grid.geometry.origin_xy_m)
    blocked = ~(np.nan_to_num(grid.probability, nan=1.0) < 0.5)
    cell_cost = cell_costs(distances_to(blocked), INFLATION)
    here = (np.asarray(start) - origin) / step
    stops = [here]
    nearest = np.full(cell_cost.shape, np.inf)
    for _ in range(STOPS):
        goal = np.array([[int(stops[-1][1]), int(stops[-1][0])]])
        nearest = np.minimum(nearest, cost_to_go(cell_cost, goal, (-1, -1)))
        reached = np.where(np.isfinite(nearest), nearest, -1.0)
        row, col = np.unravel_index(int(reached.argmax()), reached.shape)
        stops.append(np.array([col + 0.5, row + 0.5]))
    stops.append(here)
    legs = []
    for start_cell, end in pairwise(stops):
        cost = cost_to_go(cell_cost, np.array([[int(end[1]), int(end[0])]]), (-1, -1))
        path = descend_cost_to_go(cost, (float(start_cell[0]), float(start_cell[1])))
        legs.append(cv2.approxPolyDP(path.astype(np.float32)[:, None], 3.0, False)[1:, 0])
    return np.concatenate(legs).astype(np.float64) * step + origin


def judge(run: RecordedDrive, config: HandmapSlamConfig, drawing: Drawing, seed: int) -> JudgedPlace:
    """Map the drive and compare the result with the truth."""
    method = HandmapSlam(config, seed, drawing=drawing)
    method.process_at_once()
    drawn: list[DrawingPose] = []
    started = time.process_time()
    for event in run.events:
        method.process(event)
        pose = method.drawing_pose
        if pose is not None and (not drawn or drawn[-1].stamp_ns != pose.stamp_ns):
            drawn.append(pose)
    elapsed = time.process_time() - started
    result = method.result()
    path = result.trajectory
    true_path, _ = run.truth.at(path.stamps_ns)
    built = result.occupancy
    assert built is not None
    distances = wall_distances(built, run.grid, _aligned(path.poses, true_path))
    true_poses, _ = run.truth.at(np.array([p.stamp_ns for p in drawn]))
    return JudgedPlace(
        result, float(distances.accuracy.mean()), tuple(drawn), true_poses, elapsed / max(len(path), 1)
    )


def _aligned(estimate: Floats, truth: Floats) -> Floats:
    """T_truth_estimate `(3,)` with least squared distances between positions."""
    a, b = estimate[:, :2] - estimate[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    yaw = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    turned = se2.transform_points(np.array([0.0, 0.0, yaw]), estimate[:, :2].mean(axis=0)[None])[0]
    return np.array([*(truth[:, :2].mean(axis=0) - turned), yaw])


def in_distorted_building(positions: Floats) -> Floats:
    """Positions `(n, 2)` of hand-building in drawings/building-distorted.png, by a thin plate spline through the landmarks."""
    rows = load_drawing(DRAWINGS / "building-distorted.png").levels.shape[0]
    pixels = CORRESPONDENCES[:, 2:]
    drawn = np.column_stack([pixels[:, 0] + 0.5, rows - pixels[:, 1] - 0.5]) * 0.1
    plate = RBFInterpolator(CORRESPONDENCES[:, :2], drawn, kernel="thin_plate_spline", smoothing=0.01)
    return np.asarray(plate(positions))


def free_fraction(judged: JudgedPlace, drawing: Drawing, start: tuple[float, float]) -> float:
    """Fraction of the poses in the drawing that lie in its free space."""
    drawn = drawn_map(drawing, start_xy=start)
    cells = drawn.geometry.cells(np.array([(p.x, p.y) for p in judged.drawn]))
    inside = (cells >= 0).all(axis=1) & (cells < drawn.free.shape).all(axis=1)
    return float(np.mean([ok and bool(drawn.free[r, c]) for ok, (r, c) in zip(inside, cells, strict=True)]))


def return_error_m(judged: JudgedPlace) -> float:
    """Distance (m of the world) in the drawing between the first and the last pose of a robot that returns to its start."""
    first, last = judged.drawn[0], judged.drawn[-1]
    offset = judged.true_poses[-1, :2] - judged.true_poses[0, :2]
    cos, sin = np.cos(first.yaw_rad), np.sin(first.yaw_rad)
    motion = np.array([cos * offset[0] - sin * offset[1], sin * offset[0] + cos * offset[1]])
    moved = np.array([last.x - first.x, last.y - first.y]) / (last.scale_x, last.scale_y)
    return float(np.hypot(*(moved - motion)))
