from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ir_scan.config import SearchMatching, ShiftMatching
from gridslam.methods.ir_scan.given_map import GivenShiftMap, GivenWallMap
from gridslam.methods.ir_scan.matching import Shift, WallMatcher, best_shift, match_by_shift
from gridslam.methods.ir_scan.pos_grid import PosGrid
from gridslam.sensors.infrared import BeamEnds, RangeNoise, reliability, reliable_ends
from tests.methods.ir_scan.room import SEGMENTS, STOPS, scan_from

Floats = NDArray[np.float64]

PRIOR = np.diag([0.03, 0.03, 0.02]) ** 2
POSE = np.array([1.0, 0.7, 0.1])


def ends_at(pose: Floats, noise_m: float = 0.0, seed: int = 0, segments: Floats = SEGMENTS) -> BeamEnds:
    scan = scan_from(pose, np.random.default_rng(seed), noise_m, segments)
    return reliable_ends(scan, reliability(scan, 0.1))


def pos_of(poses: Floats, resolution_m: float = 0.02) -> PosGrid:
    pos = PosGrid(resolution_m, 100.0)
    for k, pose in enumerate(poses):
        pos.add(ends_at(pose, 0.003, k), pose)
    return pos


def walls_of(poses: Floats, config: SearchMatching | None = None, segments: Floats = SEGMENTS) -> WallMatcher:
    walls = WallMatcher(config or SearchMatching(), RangeNoise(), 0.01, 0.12, 100.0)
    for k, pose in enumerate(poses):
        ends = ends_at(pose, 0.003, k, segments)
        walls.add(ends.in_map(pose), np.ones(len(ends)))
    return walls


def test_of_equal_sums_the_smallest_shift_wins() -> None:
    sums = np.zeros((5, 5))
    sums[0, 4] = sums[2, 3] = sums[4, 0] = 3.0
    assert best_shift(sums) == Shift(0, 1, 3.0)
    assert best_shift(np.zeros((5, 5))) == Shift(0, 0, 0.0)


@pytest.mark.parametrize("cells", [(0, 0), (3, -2), (-10, 10)])
def test_the_papers_match_finds_a_shift_of_whole_cells(cells: tuple[int, int]) -> None:
    """The same scan again, its pose off by whole cells: the sum is largest where every point meets its own cell."""
    grid = pos_of(POSE[None]).grid
    off = POSE - np.array([0.02 * cells[1], 0.02 * cells[0], 0.0])
    ends = ends_at(POSE, 0.003, 0)
    found = match_by_shift(grid.values, grid.geometry, ends, off, PRIOR, ShiftMatching())
    assert found.verdict == "matched"
    assert np.allclose(found.pose, POSE, atol=1e-9)


def test_along_a_bare_corridor_the_papers_match_corrects_across_only() -> None:
    """A robot that is right along the corridor, and maps new ground ahead, is not pulled back where more is mapped already."""
    corridor = np.array([[-30.0, 0.0, 30.0, 0.0], [-30.0, 1.2, 30.0, 1.2]])
    stops = np.array([(0.3 * k, 0.6, 0.0) for k in range(-4, 1)])
    pos = PosGrid(0.02, 100.0)
    for k, stop in enumerate(stops):
        pos.add(ends_at(stop, 0.01, k, corridor), stop)
    true = np.array([0.4, 0.6, 0.0])
    ends = ends_at(true, 0.01, 9, corridor)
    off = true + np.array([0.0, 0.08, 0.0])
    along, across = [], []
    for tie_sigmas in (0.0, 2.5):
        config = ShiftMatching(tie_sigmas=tie_sigmas)
        found = match_by_shift(pos.grid.values, pos.grid.geometry, ends, off, PRIOR, config)
        along.append(abs(found.pose[0] - true[0]))
        across.append(abs(found.pose[1] - true[1]))
    assert along[0] >= 0.06  # the largest sum alone
    assert along[1] <= 0.021
    assert max(across) <= 0.021  # a cell


def test_a_match_that_ties_with_odometry_leaves_the_pose_and_its_covariance() -> None:
    grid = pos_of(POSE[None]).grid
    ends = ends_at(POSE, 0.003, 1)
    found = match_by_shift(grid.values, grid.geometry, ends, POSE, PRIOR, ShiftMatching())
    assert found.verdict == "matched"
    assert found.pose.tolist() == POSE.tolist()
    assert np.array_equal(found.covariance, PRIOR)


def test_without_a_positive_sum_or_with_few_points_the_pose_stays() -> None:
    ends = ends_at(POSE)
    free = np.full((200, 200), -1.0)
    geometry = GridGeometry(0.02, (0.0, 0.0))
    found = match_by_shift(free, geometry, ends, POSE, PRIOR, ShiftMatching())
    assert (found.verdict, found.pose.tolist()) == ("no_match", POSE.tolist())
    few = match_by_shift(-free, geometry, ends, POSE, PRIOR, ShiftMatching(least_points=1000))
    assert (few.verdict, few.pose.tolist()) == ("too_few_points", POSE.tolist())


def test_a_scan_that_hardly_meets_the_map_is_not_pulled_to_what_it_meets() -> None:
    """A map of one short piece of wall: the best shift lays a few points on it, and says nothing of the rest."""
    values = np.zeros((200, 200))
    ends = ends_at(POSE)
    geometry = GridGeometry(0.02, (0.0, 0.0))
    met = np.unique(geometry.cells(ends.in_map(POSE))[:8], axis=0)
    values[met[:, 0], met[:, 1]] = 5.0
    off = POSE + np.array([0.06, 0.0, 0.0])
    pulled = match_by_shift(values, geometry, ends, off, PRIOR, ShiftMatching(least_share=0.0))
    assert pulled.verdict == "matched"
    kept = match_by_shift(values, geometry, ends, off, PRIOR, ShiftMatching())
    assert (kept.verdict, kept.pose.tolist()) == ("no_match", off.tolist())


def test_on_a_turned_map_shifts_are_turned_as_well() -> None:
    values = np.zeros((100, 100))
    values[40, 60] = 1.0
    geometry = GridGeometry(0.1, (2.0, 1.0), np.pi / 2)
    target = geometry.centres(np.array([[40, 60]]))[0]
    one = BeamEnds(
        np.zeros((1, 2)),
        np.zeros((1, 2)),
        np.array([[1.0, 0.0]]),
        np.ones(1),
        np.ones(1),
        np.zeros(1, np.int64),
    )
    start = np.append(target - [0.3, -0.2], 0.0)
    found = match_by_shift(values, geometry, one, start, PRIOR, ShiftMatching(least_points=1, tie_sigmas=0.0))
    assert np.allclose(found.pose[:2], target)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_finds_shift_and_rotation_to_fractions_of_a_cell(seed: int) -> None:
    off = np.random.default_rng(seed).uniform(-1.0, 1.0, 3) * [0.05, 0.05, 0.04]
    found = walls_of(STOPS).match(
        ends_at(POSE, 0.003, 50 + seed), POSE + off, np.diag([0.05, 0.05, 0.04]) ** 2
    )
    assert found.verdict == "matched"
    assert np.hypot(*(found.pose - POSE)[:2]) < 0.004
    assert abs(se2.wrap_angle(found.pose[2] - POSE[2])) < 0.005
    assert np.sqrt(found.covariance[0, 0]) < 0.005


def test_along_a_corridor_the_search_refuses_unless_odometry_knows() -> None:
    """Two walls without an end: any shift along them fits."""
    corridor = np.array([[-30.0, 0.0, 30.0, 0.0], [-30.0, 1.2, 30.0, 1.2]])
    stops = np.array([(0.3 * k, 0.6, 0.0) for k in range(-8, 9)])
    walls = walls_of(stops, segments=corridor)
    ends = ends_at(np.array([0.0, 0.6, 0.0]), 0.003, 9, corridor)
    off = np.array([0.03, 0.58, 0.01])
    refused = walls.match(ends, off, np.diag([0.2, 0.02, 0.02]) ** 2)
    assert (refused.verdict, refused.pose.tolist()) == ("ambiguous", off.tolist())
    across = walls.match(ends, off, np.diag([0.01, 0.02, 0.02]) ** 2)
    assert across.verdict == "matched"
    assert across.pose[1] == pytest.approx(0.6, abs=0.003)
    assert across.pose[2] == pytest.approx(0.0, abs=0.003)
    assert across.pose[0] == pytest.approx(0.03, abs=0.01)  # nothing is known along the walls


def test_an_empty_map_a_far_pose_and_few_points_give_no_correction() -> None:
    ends = ends_at(POSE)
    empty = WallMatcher(SearchMatching(), RangeNoise(), 0.01, 0.12, 100.0)
    assert empty.match(ends, POSE, PRIOR).verdict == "first"
    walls = walls_of(STOPS)
    assert walls.match(ends, POSE + np.array([30.0, 0.0, 0.0]), PRIOR).verdict == "no_match"
    none = reliable_ends(scan_from(POSE, np.random.default_rng(0)), np.zeros(183))
    assert walls.match(none, POSE, PRIOR).verdict == "too_few_points"


def test_a_given_map_serves_both_matches() -> None:
    made = pos_of(STOPS, 0.03).occupancy()
    corner = np.array([0.5, 0.5, 0.1])
    off = corner + np.array([0.06, -0.05, 0.0])
    ends = ends_at(corner, 0.003, 77)
    shifted = GivenShiftMap(made, ShiftMatching()).match(ends, off, PRIOR)
    assert np.hypot(*(shifted.pose - corner)[:2]) < 0.045
    searched = GivenWallMap(made, SearchMatching(), RangeNoise(), 100.0).match(
        ends, off, np.diag([0.06, 0.06, 0.02]) ** 2
    )
    assert searched.verdict == "matched"
    assert np.hypot(*(searched.pose - corner)[:2]) < 0.015  # half a cell
    nothing = OccupancyGrid(np.full((50, 50), np.nan, np.float32), GridGeometry(0.03, (0.0, 0.0)))
    assert (
        GivenWallMap(nothing, SearchMatching(), RangeNoise(), 100.0).match(ends, off, PRIOR).verdict
        == "no_match"
    )
    assert GivenShiftMap(nothing, ShiftMatching()).match(ends, off, PRIOR).verdict == "no_match"
