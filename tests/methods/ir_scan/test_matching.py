from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ir_scan.given_map import GivenShiftMap, GivenWallMap
from gridslam.methods.ir_scan.pos_grid import PosGrid
from gridslam.methods.ir_scan.shift_matching import CellShift, ShiftSettings, best_shift, match_by_shift
from gridslam.methods.ir_scan.stops import StopMatch
from gridslam.methods.ir_scan.wall_matching import SearchSettings, WallMatcher
from gridslam.sensors.infrared import RangeNoise, ReliableReadings, reliability, reliable_readings
from tests.methods.ir_scan.room import SEGMENTS, STOPS, scan_from

Floats = NDArray[np.float64]

COVARIANCE = np.diag([0.03, 0.03, 0.02]) ** 2
POSE = np.array([1.0, 0.7, 0.1])


def readings_at(
    pose: Floats, noise_m: float = 0.0, seed: int = 0, segments: Floats = SEGMENTS
) -> ReliableReadings:
    scan = scan_from(pose, np.random.default_rng(seed), noise_m, segments)
    return reliable_readings(scan, reliability(scan, 0.1))


def prior_at(pose: Floats, covariance: Floats = COVARIANCE) -> StopMatch:
    return StopMatch(pose, covariance, "off")


def matcher_of(settings: SearchSettings | None = None) -> WallMatcher:
    return WallMatcher(
        settings or SearchSettings(), RangeNoise(), resolution_m=0.01, window_m=0.12, memory_limit_mb=100.0
    )


def pos_of(poses: Floats, resolution_m: float = 0.02) -> PosGrid:
    pos = PosGrid(resolution_m, 100.0)
    for k, pose in enumerate(poses):
        pos.add(readings_at(pose, 0.003, k), pose)
    return pos


def walls_of(poses: Floats, segments: Floats = SEGMENTS) -> WallMatcher:
    walls = matcher_of()
    for k, pose in enumerate(poses):
        readings = readings_at(pose, 0.003, k, segments)
        walls.add(readings.in_map(pose), np.ones(len(readings)))
    return walls


def test_the_smallest_shift_wins_among_equal_sums() -> None:
    sums = np.zeros((5, 5))
    sums[0, 4] = sums[2, 3] = sums[4, 0] = 3.0
    assert best_shift(sums) == CellShift(0, 1, 3.0)
    assert best_shift(np.zeros((5, 5))) == CellShift(0, 0, 0.0)


@pytest.mark.parametrize("cells", [(0, 0), (3, -2), (-10, 10)])
def test_the_papers_match_finds_a_shift_of_whole_cells(cells: tuple[int, int]) -> None:
    """The same scan with a pose that is off by whole cells: the sum is largest where every point meets its own cell."""
    grid = pos_of(POSE[None]).grid
    off = POSE - np.array([0.02 * cells[1], 0.02 * cells[0], 0.0])
    readings = readings_at(POSE, 0.003, 0)
    found = match_by_shift(grid.values, grid.geometry, readings, prior_at(off), ShiftSettings())
    assert found.verdict == "matched"
    assert np.allclose(found.pose, POSE, atol=1e-9)


def test_along_a_bare_corridor_the_papers_match_corrects_the_lateral_error_only() -> None:
    """A robot that maps new ground ahead is not pulled back to the part of the corridor that is mapped already."""
    corridor = np.array([[-30.0, 0.0, 30.0, 0.0], [-30.0, 1.2, 30.0, 1.2]])
    stops = np.array([(0.3 * k, 0.6, 0.0) for k in range(-4, 1)])
    pos = PosGrid(0.02, 100.0)
    for k, stop in enumerate(stops):
        pos.add(readings_at(stop, 0.01, k, corridor), stop)
    true = np.array([0.4, 0.6, 0.0])
    readings = readings_at(true, 0.01, 9, corridor)
    off = true + np.array([0.0, 0.08, 0.0])
    along, across = [], []
    for tie_sigmas in (0.0, 2.5):
        settings = ShiftSettings(tie_sigmas=tie_sigmas)
        found = match_by_shift(pos.grid.values, pos.grid.geometry, readings, prior_at(off), settings)
        along.append(abs(found.pose[0] - true[0]))
        across.append(abs(found.pose[1] - true[1]))
    assert along[0] >= 0.06  # the largest sum alone
    assert along[1] <= 0.021
    assert max(across) <= 0.021  # a cell


def test_a_match_that_ties_with_odometry_keeps_pose_and_covariance() -> None:
    grid = pos_of(POSE[None]).grid
    readings = readings_at(POSE, 0.003, 1)
    found = match_by_shift(grid.values, grid.geometry, readings, prior_at(POSE), ShiftSettings())
    assert found.verdict == "matched"
    assert found.pose.tolist() == POSE.tolist()
    assert np.array_equal(found.covariance, COVARIANCE)


def test_without_a_positive_sum_or_with_few_points_there_is_no_correction() -> None:
    readings = readings_at(POSE)
    free = np.full((200, 200), -1.0)
    geometry = GridGeometry(0.02, (0.0, 0.0))
    found = match_by_shift(free, geometry, readings, prior_at(POSE), ShiftSettings())
    assert (found.verdict, found.pose.tolist()) == ("no_match", POSE.tolist())
    few = match_by_shift(-free, geometry, readings, prior_at(POSE), ShiftSettings(min_points=1000))
    assert (few.verdict, few.pose.tolist()) == ("too_few_points", POSE.tolist())


def test_a_scan_with_few_inliers_is_not_pulled_to_them() -> None:
    """On a map of one short wall segment the best shift lays a few points on it; the others meet unknown cells."""
    values = np.zeros((200, 200))
    readings = readings_at(POSE)
    geometry = GridGeometry(0.02, (0.0, 0.0))
    met = np.unique(geometry.cells(readings.in_map(POSE))[:8], axis=0)
    values[met[:, 0], met[:, 1]] = 5.0
    off = POSE + np.array([0.06, 0.0, 0.0])
    pulled = match_by_shift(values, geometry, readings, prior_at(off), ShiftSettings(min_inlier_ratio=0.0))
    assert pulled.verdict == "matched"
    kept = match_by_shift(values, geometry, readings, prior_at(off), ShiftSettings())
    assert (kept.verdict, kept.pose.tolist()) == ("no_match", off.tolist())


def test_shifts_follow_the_axes_of_a_rotated_map() -> None:
    values = np.zeros((100, 100))
    values[40, 60] = 1.0
    geometry = GridGeometry(0.1, (2.0, 1.0), np.pi / 2)
    target = geometry.centres(np.array([[40, 60]]))[0]
    one = ReliableReadings(
        np.zeros((1, 2)),
        np.zeros((1, 2)),
        np.array([[1.0, 0.0]]),
        np.ones(1),
        np.ones(1),
        np.zeros(1, np.int64),
    )
    start = np.append(target - [0.3, -0.2], 0.0)
    found = match_by_shift(
        values, geometry, one, prior_at(start), ShiftSettings(min_points=1, tie_sigmas=0.0)
    )
    assert np.allclose(found.pose[:2], target)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_finds_shift_and_rotation_to_fractions_of_a_cell(seed: int) -> None:
    off = np.random.default_rng(seed).uniform(-1.0, 1.0, 3) * [0.05, 0.05, 0.04]
    found = walls_of(STOPS).match(
        readings_at(POSE, 0.003, 50 + seed), prior_at(POSE + off, np.diag([0.05, 0.05, 0.04]) ** 2)
    )
    assert found.verdict == "matched"
    assert np.hypot(*(found.pose - POSE)[:2]) < 0.004
    assert abs(se2.wrap_angle(found.pose[2] - POSE[2])) < 0.005
    assert np.sqrt(found.covariance[0, 0]) < 0.005


def test_along_a_corridor_the_search_is_ambiguous_unless_odometry_is_certain() -> None:
    """Between two walls without an end any shift along them matches."""
    corridor = np.array([[-30.0, 0.0, 30.0, 0.0], [-30.0, 1.2, 30.0, 1.2]])
    stops = np.array([(0.3 * k, 0.6, 0.0) for k in range(-8, 9)])
    walls = walls_of(stops, segments=corridor)
    readings = readings_at(np.array([0.0, 0.6, 0.0]), 0.003, 9, corridor)
    off = np.array([0.03, 0.58, 0.01])
    refused = walls.match(readings, prior_at(off, np.diag([0.2, 0.02, 0.02]) ** 2))
    assert (refused.verdict, refused.pose.tolist()) == ("ambiguous", off.tolist())
    across = walls.match(readings, prior_at(off, np.diag([0.01, 0.02, 0.02]) ** 2))
    assert across.verdict == "matched"
    assert across.pose[1] == pytest.approx(0.6, abs=0.003)
    assert across.pose[2] == pytest.approx(0.0, abs=0.003)
    assert across.pose[0] == pytest.approx(0.03, abs=0.01)  # no evidence along the walls


def test_an_empty_map_a_distant_pose_and_few_points_give_no_correction() -> None:
    readings = readings_at(POSE)
    empty = matcher_of()
    assert empty.match(readings, prior_at(POSE)).verdict == "first"
    walls = walls_of(STOPS)
    assert walls.match(readings, prior_at(POSE + np.array([30.0, 0.0, 0.0]))).verdict == "no_match"
    none = reliable_readings(scan_from(POSE, np.random.default_rng(0)), np.zeros(183))
    assert walls.match(none, prior_at(POSE)).verdict == "too_few_points"


def test_both_matches_work_on_a_given_map() -> None:
    occupancy = pos_of(STOPS, 0.03).occupancy()
    corner = np.array([0.5, 0.5, 0.1])
    off = corner + np.array([0.06, -0.05, 0.0])
    readings = readings_at(corner, 0.003, 77)
    shifted = GivenShiftMap(occupancy, ShiftSettings()).match(readings, prior_at(off))
    assert np.hypot(*(shifted.pose - corner)[:2]) < 0.045
    searched = GivenWallMap(occupancy, SearchSettings(), RangeNoise(), 100.0).match(
        readings, prior_at(off, np.diag([0.06, 0.06, 0.02]) ** 2)
    )
    assert searched.verdict == "matched"
    assert np.hypot(*(searched.pose - corner)[:2]) < 0.015  # half a cell
    nothing = OccupancyGrid(np.full((50, 50), np.nan, np.float32), GridGeometry(0.03, (0.0, 0.0)))
    assert (
        GivenWallMap(nothing, SearchSettings(), RangeNoise(), 100.0).match(readings, prior_at(off)).verdict
        == "no_match"
    )
    assert GivenShiftMap(nothing, ShiftSettings()).match(readings, prior_at(off)).verdict == "no_match"
