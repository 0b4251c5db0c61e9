"""Paths over the drawing as corrected by the lidar (handmap-slam, paper section 4)."""

from __future__ import annotations

import numpy as np

from gridslam.core.messages import LaserScan, readonly
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.pathfinder import CostGrid, FoundPath, find_path, observed_costs
from gridslam.methods.handmap_slam.driving.plan_grid import PlanGrid, plan_grid
from gridslam.methods.handmap_slam.scan_memory import BeamEndpoints, ScanMemory, beam_endpoints
from gridslam.sensors.lidar_beams import LidarExtrinsics

CONFIG = ExplorationConfig()
HERE = DrawingPose(0, 1.5, 2.0, 0.0, scale_x=1.0, scale_y=1.0, position_std=0.0, inlier_ratio=1.0)
GOAL = np.array([6.5, 2.0])


def corridor(closed: bool = False) -> PlanGrid:
    """8 x 4 m of free space, drawn at 0.1 m per pixel; `closed`: with a wall across the middle."""
    walls = np.zeros((40, 80), bool)
    walls[[0, -1]] = walls[:, [0, -1]] = True
    if closed:
        walls[:, 40] = True
    drawn = DrawnMap(~walls, walls, "dark", False, GridGeometry(0.1, (0.0, 0.0)))
    return plan_grid(drawn, 1.0, 1.0, 0.1)


def scan_of(*surfaces: tuple[float, float, float, float]) -> BeamEndpoints:
    """720 beams of up to 8 m at surfaces (x0, y0, x1, y1) in the robot's frame."""
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    direction = np.column_stack([np.cos(bearings), np.sin(bearings)])
    ranges = np.full(720, 8.0)
    for x0, y0, x1, y1 in surfaces:
        side = np.array([x1 - x0, y1 - y0])
        cross = direction[:, 0] * side[1] - direction[:, 1] * side[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (x0 * side[1] - y0 * side[0]) / cross
            u = (x0 * direction[:, 1] - y0 * direction[:, 0]) / cross
        ranges = np.where((t > 0.0) & (u >= 0.0) & (u <= 1.0), np.minimum(ranges, t), ranges)
    return BeamEndpoints(0, np.zeros(2), direction * ranges[:, None], ranges < 8.0)


def path(grid: PlanGrid, *surfaces: tuple[float, float, float, float]) -> FoundPath:
    memory = ScanMemory()
    if surfaces:
        memory.add(np.zeros(3), scan_of(*surfaces))
    blocked, cleared = memory.cells_on(grid, np.zeros(3), HERE)
    cell_cost = observed_costs(grid, blocked, cleared, 0.25, CONFIG)
    return find_path(CostGrid(grid, cell_cost, blocked | (grid.walls & ~cleared)), HERE, GOAL, 0.25, 0.2)


def test_without_observations_the_path_is_straight() -> None:
    found = path(corridor())
    assert 4.5 < found.cost_m < 5.5
    assert np.abs(found.path[:, 1]).max() < 0.3
    assert found.path[-1, 0] > 4.7


def test_the_path_keeps_clear_of_a_box_missing_from_the_drawing() -> None:
    box = ((2.0, -0.5, 2.0, 0.5), (2.0, 0.5, 3.0, 0.5), (2.0, -0.5, 3.0, -0.5))
    found = path(corridor(), *box)
    beside = found.path[(found.path[:, 0] > 1.9) & (found.path[:, 0] < 2.8)]
    assert len(beside)
    assert np.abs(beside[:, 1]).min() > 0.5 + 0.25


def test_an_observed_wall_across_the_corridor_closes_it() -> None:
    found = path(corridor(), (2.5, -2.5, 2.5, 2.5))
    assert np.isinf(found.cost_m)


def test_a_drawn_wall_that_beams_pass_through_closes_nothing() -> None:
    assert np.isinf(path(corridor(closed=True)).cost_m)
    assert np.isfinite(path(corridor(closed=True), (6.3, -1.9, 6.3, 1.9)).cost_m)


def test_a_goal_in_an_obstacle_is_reported_as_solid() -> None:
    surfaces = ((3.8, -2.0, 3.8, 2.0),)
    grid = corridor()
    memory = ScanMemory()
    memory.add(np.zeros(3), scan_of(*surfaces))
    blocked, cleared = memory.cells_on(grid, np.zeros(3), HERE)
    cell_cost = observed_costs(grid, blocked, cleared, 0.25, CONFIG)
    found = find_path(CostGrid(grid, cell_cost, blocked), HERE, np.array([5.3, 2.0]), 0.25, 0.04)
    assert found.is_goal_solid


def scan(ranges: list[float]) -> LaserScan:
    return LaserScan(0, "laser", readonly(ranges, np.float32), 0.0, 0.1, 0.1, 30.0)


def test_single_beams_without_return_are_dropped_and_a_row_of_them_is_free_space() -> None:
    lonely = beam_endpoints(
        scan([2.0, np.inf, 2.0, np.nan, 2.0]), LidarExtrinsics(np.zeros(3)), np.zeros(3), 8.0
    )
    assert len(lonely.endpoints) == 3
    row = beam_endpoints(
        scan([2.0, np.inf, np.inf, np.inf, np.inf, 12.0]), LidarExtrinsics(np.zeros(3)), np.zeros(3), 8.0
    )
    assert row.is_hit.tolist() == [True, False, False, False, False, False]
    np.testing.assert_allclose(np.hypot(*row.endpoints[1:].T), 8.0, rtol=1e-5)
