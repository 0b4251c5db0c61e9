"""The drawing in cells that are square in the world."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.plan_grid import plan_grid


def drawn(rows: int = 40, cols: int = 60) -> DrawnMap:
    """A room with a thin wall across it."""
    walls = np.zeros((rows, cols), bool)
    walls[[0, -1]] = walls[:, [0, -1]] = True
    walls[:30, 30] = True
    return DrawnMap(~walls, walls, "dark", False, GridGeometry(0.1, (0.0, 0.0)))


@pytest.mark.parametrize("scales", [(0.5, 0.5), (1.0, 1.0), (2.3, 1.7), (4.0, 3.0)])
def test_no_wall_is_lost_at_any_scale(scales: tuple[float, float]) -> None:
    grid = plan_grid(drawn(), *scales, 0.1)
    across = int(3.05 / grid.cell_xy[0])
    high = int(2.5 / grid.cell_xy[1])
    assert grid.walls[1:high, across - 1 : across + 2].any(axis=1).all()
    assert not (grid.free & grid.walls).any()
    assert grid.cell_xy == pytest.approx((0.1 * scales[0], 0.1 * scales[1]))


def test_points_of_the_robot_s_frame_transform_to_cells_and_back() -> None:
    grid = plan_grid(drawn(), 2.0, 1.5, 0.1)
    pose = DrawingPose(0, 2.0, 1.0, 0.7, scale_x=2.0, scale_y=1.5, position_std=0.0, inlier_ratio=1.0)
    points = np.random.default_rng(0).normal(0.0, 1.0, (20, 2))
    cells = grid.robot_to_cells(points, pose)
    np.testing.assert_allclose(grid.robot_from_cells(cells, pose), points, atol=1e-12)
    # a metre of the world is ten cells, whatever the scales
    ahead = grid.robot_to_cells(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), pose)
    np.testing.assert_allclose(np.hypot(*(ahead[1:] - ahead[0]).T), 10.0)


def test_a_very_large_drawing_gets_larger_cells() -> None:
    grid = plan_grid(drawn(), 0.001, 0.001, 0.1)
    assert grid.walls.size < 4.2e6
    assert grid.cell_m > 0.1
