"""Obstacle regions: closed passages, areas, boxes and gaps, on maps small enough to count by hand."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.planning.obstacles import close_passages, obstacle_cells, obstacle_regions


def two_blocks(gap_cells: int, yaw_rad: float = 0.0) -> OccupancyGrid:
    """Two blocks of 10 x 10 cells of 5 cm, one beside the other."""
    probability = np.full((40, 60), 0.1, np.float32)
    probability[10:20, 10:20] = 0.95
    probability[10:20, 20 + gap_cells : 30 + gap_cells] = 0.95
    return OccupancyGrid(probability, GridGeometry(0.05, (-1.0, 2.0), yaw_rad))


def test_a_passage_wider_than_the_robot_remains_open_and_its_width_is_the_gap() -> None:
    regions = obstacle_regions(two_blocks(gap_cells=9), robot_radius_m=0.2)
    assert [r.cells for r in regions] == [100, 100]
    assert [r.gap_m for r in regions] == pytest.approx([0.45, 0.45])
    assert [r.nearest_id for r in regions] == [2, 1]
    assert regions[0].area_m2 == pytest.approx(0.25)
    first = regions[0]
    assert (first.x, first.y) == pytest.approx((-0.25, 2.75))
    assert (first.min_x, first.min_y, first.max_x, first.max_y) == pytest.approx((-0.5, 2.5, 0.0, 3.0))


def test_a_passage_narrower_than_the_robot_is_closed() -> None:
    (region,) = obstacle_regions(two_blocks(gap_cells=5), robot_radius_m=0.2)
    assert region.cells == 200 + region.closed_cells
    # The middle of the passage; the disc extends slightly into both ends
    assert 10 <= region.closed_cells <= 50
    assert region.gap_m == np.inf
    assert region.nearest_id == 0


def test_closing_equals_testing_the_disc_at_every_cell() -> None:
    rng = np.random.default_rng(3)
    obstacles = rng.random((30, 40)) < 0.02
    closed = close_passages(obstacles, 0.1, 0.25)
    rows, cols = np.mgrid[-5:35, -5:45]
    cells = np.argwhere(obstacles)
    places = np.stack([rows.ravel(), cols.ravel()], axis=1)
    offsets = np.abs(places[:, None] - cells[None])
    free = places[(np.hypot(*np.moveaxis(offsets, -1, 0)) > 3.0).all(axis=1)]
    for cell in np.argwhere(np.ones_like(obstacles)):
        covered = (np.hypot(*(free - cell).T) <= 2.5).any()
        assert closed[tuple(cell)] == (obstacles[tuple(cell)] or not covered)


def test_unknown_cells_are_obstacles_only_on_request() -> None:
    grid = two_blocks(gap_cells=9)
    grid.probability[0:5] = np.nan
    assert obstacle_cells(grid).sum() == 200
    assert obstacle_cells(grid, unknown_blocks=True).sum() == 200 + 5 * 60
    assert obstacle_cells(grid, occupied_from=0.96).sum() == 0


def test_small_regions_are_dropped_and_a_free_map_has_none() -> None:
    grid = two_blocks(gap_cells=9)
    grid.probability[35, 50] = 1.0
    assert len(obstacle_regions(grid)) == 3
    assert len(obstacle_regions(grid, min_cells=2)) == 2
    assert obstacle_regions(OccupancyGrid(np.zeros((5, 5), np.float32), grid.geometry)) == []


def test_a_rotated_grid_gives_boxes_in_the_map_frame() -> None:
    turned = obstacle_regions(two_blocks(gap_cells=9, yaw_rad=np.pi / 2))[0]
    straight = obstacle_regions(two_blocks(gap_cells=9))[0]
    assert turned.min_x == pytest.approx(-1.0 - (straight.max_y - 2.0))
    assert turned.max_y == pytest.approx(2.0 + (straight.max_x + 1.0))
