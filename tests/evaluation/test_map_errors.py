from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.poses import compose, inverse
from gridslam.evaluation.map_errors import _near_known, intersection_over_union, log_loss, wall_distances
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

HERE = np.zeros(3)


def grid(rows: list[str], resolution_m: float = 0.1, x: float = 0.0, y: float = 0.0) -> OccupancyGrid:
    """`#` wall, `.` free, space unknown; the first line is the top row."""
    values = {"#": 1.0, ".": 0.0, " ": math.nan}
    cells = np.array([[values[c] for c in row] for row in rows[::-1]], np.float32)
    return OccupancyGrid(cells, GridGeometry(resolution_m, (x, y)))


ROOM = grid(["#####", "#...#", "#...#", "#####"])


def test_a_map_is_at_no_distance_from_itself() -> None:
    walls = wall_distances(ROOM, ROOM, HERE)
    assert walls.accuracy.tolist() == [0.0] * 14
    assert walls.completeness.tolist() == [0.0] * 10  # the four corners border on no free cell
    assert intersection_over_union(ROOM, ROOM, HERE) == 1.0


def test_distances_go_from_each_wall_cell_to_the_nearest_one() -> None:
    truth = grid(["....#", "....#"])
    built = grid([".#...", "....#"])
    walls = wall_distances(built, truth, HERE)
    assert sorted(walls.accuracy) == pytest.approx([0.0, 0.3])
    # the upper true cell: 0.1 to the lower mapped one
    assert sorted(walls.completeness) == pytest.approx([0.0, 0.1])
    assert intersection_over_union(built, truth, HERE) == pytest.approx(1 / 3)


def test_the_inside_of_a_thick_wall_need_not_be_mapped() -> None:
    truth = grid(["....", "####", "####", "####"])
    built = grid(["....", "####", "    ", "    "])
    assert wall_distances(built, truth, HERE).completeness.tolist() == [0.0] * 4


def test_the_completeness_radius_leaves_out_walls_far_from_the_map() -> None:
    truth = grid(["#........#"])
    built = grid(["#...      "])
    assert sorted(wall_distances(built, truth, HERE).completeness) == pytest.approx([0.0, 0.9])
    assert wall_distances(built, truth, HERE, completeness_radius_m=0.2).completeness.tolist() == [0.0]


def test_a_map_in_another_frame_is_moved_into_the_truths() -> None:
    T_truth_built = np.array([1.3, -0.4, 0.7])
    x, y, yaw = compose(inverse(T_truth_built), np.zeros(3)).tolist()  # of the corner of cell (0, 0)
    elsewhere = OccupancyGrid(ROOM.probability, GridGeometry(0.1, (x, y), yaw))
    walls = wall_distances(elsewhere, ROOM, T_truth_built)
    assert walls.accuracy == pytest.approx(np.zeros(14), abs=1e-9)
    assert intersection_over_union(elsewhere, ROOM, T_truth_built) == 1.0
    assert wall_distances(elsewhere, ROOM, HERE).accuracy.max() > 0.1


def test_maps_compared_a_few_rows_at_a_time_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    T_truth_built = np.array([0.13, -0.04, 0.2])
    whole = intersection_over_union(ROOM, ROOM, T_truth_built)
    monkeypatch.setattr("gridslam.evaluation.map_errors._CELLS_AT_ONCE", 10)
    assert intersection_over_union(ROOM, ROOM, T_truth_built) == whole
    assert 0.0 < whole < 1.0


def test_log_loss_is_the_mean_over_cells_that_both_know() -> None:
    truth = grid(["#. #"])
    built = OccupancyGrid(np.array([[0.8, 0.1, 0.5, np.nan]], np.float32), truth.geometry)
    loss, cells = log_loss(built, truth, HERE)
    assert loss == pytest.approx(-(math.log(0.8) + math.log(0.9)) / 2, rel=1e-6)
    assert cells == 2


def test_a_wrong_certainty_is_dear_but_finite() -> None:
    truth = grid(["#"])
    loss, _ = log_loss(OccupancyGrid(np.zeros((1, 1), np.float32), truth.geometry), truth, HERE)
    assert loss == pytest.approx(-math.log(1e-6))


def test_a_map_without_walls_has_no_distances() -> None:
    empty = grid(["....", "...."])
    assert len(wall_distances(empty, empty, HERE).accuracy) == 0
    assert math.isnan(intersection_over_union(empty, empty, HERE))


@pytest.mark.parametrize("radius_m", [0.02, 0.1, 0.6])
def test_points_near_known_cells_are_those_near_any_of_them(radius_m: float) -> None:
    rng = np.random.default_rng(3)
    values = np.where(rng.random((40, 50)) < 0.3, np.nan, 0.5).astype(np.float32)
    values[10:30, 5:40] = 0.5
    built = OccupancyGrid(values, GridGeometry(0.1, (1.0, -2.0), 0.4))
    pose = np.array([0.3, 0.2, 1.0])
    points = rng.uniform(-6.0, 6.0, (3000, 2))
    known = se2.transform_points(pose, built.geometry.centres(np.argwhere(~np.isnan(values))))
    expected = cKDTree(known).query(points)[0] <= radius_m
    np.testing.assert_array_equal(_near_known(built, pose, points, radius_m), expected)
    assert 0 < expected.sum() < len(points)


def test_maps_looked_at_a_few_rows_at_a_time_have_the_same_walls_and_losses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(1)
    built, truth = (
        OccupancyGrid(
            rng.choice([0.1, 0.9, np.nan], (23, 9)).astype(np.float32), GridGeometry(0.1, (0.0, 0.0))
        )
        for _ in range(2)
    )
    whole = wall_distances(built, truth, HERE, 0.3), log_loss(built, truth, HERE)
    monkeypatch.setattr("gridslam.evaluation.map_errors._CELLS_AT_ONCE", 36)
    pieces = wall_distances(built, truth, HERE, 0.3), log_loss(built, truth, HERE)
    np.testing.assert_array_equal(pieces[0].accuracy, whole[0].accuracy)
    np.testing.assert_array_equal(pieces[0].completeness, whole[0].completeness)
    assert pieces[1] == pytest.approx(whole[1])
