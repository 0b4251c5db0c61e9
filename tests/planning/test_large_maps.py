"""Planning over maps with more cells than the planner takes at once."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.errors import MethodError
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.planning import arcs_and_lines, large_maps
from gridslam.planning.arcs_and_lines import plan_path
from gridslam.report.plan import SEGMENT_COLUMNS, segment_row
from tests.reference.path_checks import Squares, drive

START, GOAL = np.array([1.0, 1.0, 0.0]), np.array([5.0, 1.0, -np.pi / 2])


def room(gap_cells: int = 20) -> OccupancyGrid:
    """A room of 6 x 4 m with a wall in the middle that leaves a gap at its upper end."""
    probability = np.zeros((80, 120), np.float32)
    probability[[0, -1]] = probability[:, [0, -1]] = 1.0
    probability[: 79 - gap_cells, 58:62] = 1.0
    return OccupancyGrid(probability, GridGeometry(0.05, (0.0, 0.0)))


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans over at most 2,500 cells: the room has 9,600."""
    for module in (large_maps, arcs_and_lines):
        monkeypatch.setattr(module, "MAX_CELLS", 2_500)


def test_a_coarse_cell_is_occupied_if_any_of_its_cells_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_maps, "MAX_CELLS", 6)
    probability = np.zeros((4, 5), np.float32)
    probability[0, 0], probability[1, 3], probability[3, 2] = 0.95, np.nan, 0.8
    coarse = large_maps.coarsened(OccupancyGrid(probability, GridGeometry(0.05, (1.0, 2.0), 0.3)), 0.9)
    # The last column has one column of cells only; the rest lies beyond the map's edge, which blocks.
    np.testing.assert_array_equal(coarse.probability, [[1.0, np.nan, 1.0], [0.0, 0.0, 1.0]])
    assert coarse.geometry == GridGeometry(0.1, (1.0, 2.0), 0.3)


def test_a_window_has_the_cells_around_start_and_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_maps, "WINDOW_MARGIN_M", 0.5)
    grid = OccupancyGrid(
        np.random.default_rng(0).random((80, 120)).astype(np.float32), GridGeometry(0.05, (-1.0, 2.0), 0.4)
    )
    start, goal = grid.geometry.centres(np.array([[20, 30], [40, 70]]))
    window = large_maps.window_around(grid, start, goal)
    assert window is not None
    np.testing.assert_array_equal(window.probability, grid.probability[10:51, 20:81])
    np.testing.assert_allclose(
        window.geometry.centres(np.array([[0, 0]])), grid.geometry.centres(np.array([[10, 20]]))
    )


def test_a_pose_outside_the_map_has_no_window() -> None:
    assert large_maps.window_around(room(), START, np.array([50.0, 1.0, 0.0])) is None


@pytest.mark.usefixtures("limited")
def test_a_path_over_coarse_cells_is_free_on_the_map() -> None:
    grid = room()
    plan = plan_path(grid, START, GOAL)
    rows = [dict(zip(SEGMENT_COLUMNS, segment_row(s), strict=True)) for s in plan.path.segments]
    poses = np.vstack([drive(row) for row in rows])  # type: ignore[arg-type]
    assert Squares(grid).distances(poses[:, :2], 0.5).min() >= 0.2 - 1e-4
    np.testing.assert_allclose(poses[-1, :2], GOAL[:2], atol=1e-4)


@pytest.mark.usefixtures("limited")
def test_a_refusal_over_coarse_cells_says_so() -> None:
    with pytest.raises(
        MethodError, match=r"planned in cells of 0\.1 m, because the map has more than 2500 cells"
    ):
        plan_path(room(gap_cells=0), START, GOAL)


@pytest.mark.usefixtures("limited")
def test_a_window_is_planned_over_in_the_map_s_own_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_maps, "WINDOW_MARGIN_M", 0.6)
    start, goal = np.array([1.0, 1.0, np.pi / 2]), np.array([1.0, 3.0, np.pi / 2])
    asked: list[OccupancyGrid] = []
    original = arcs_and_lines.make_space
    monkeypatch.setattr(
        arcs_and_lines, "make_space", lambda grid, *rest: (asked.append(grid), original(grid, *rest))[1]
    )
    assert plan_path(room(), start, goal).path.length_m == pytest.approx(2.0)
    assert [grid.geometry.resolution_m for grid in asked] == [0.05]


@pytest.mark.usefixtures("limited")
def test_poses_searched_on_a_large_map_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arcs_and_lines, "LARGE_MAP_STATES", 20)
    with pytest.raises(MethodError, match=r"no path found among \d+ poses.*crop the map"):
        plan_path(room(), START, GOAL)


@pytest.mark.parametrize("very_long_m", [3.0, 1e9])
def test_a_long_path_is_the_only_candidate(monkeypatch: pytest.MonkeyPatch, very_long_m: float) -> None:
    assert len(plan_path(room(), START, GOAL).candidates) > 1
    monkeypatch.setattr(arcs_and_lines, "LONG_PATH_M", 3.0)
    monkeypatch.setattr(arcs_and_lines, "VERY_LONG_PATH_M", very_long_m)
    path = plan_path(room(), START, GOAL)
    assert len(path.candidates) == 1
    assert path.path.length_m > 4.0
