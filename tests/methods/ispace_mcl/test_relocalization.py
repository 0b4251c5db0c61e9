from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core import poses as se2
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation
from gridslam.methods.ispace_mcl.continuity import overlap_of
from gridslam.methods.ispace_mcl.search.hypothesis_scores import (
    DISCONTINUOUS_LOG_ODDS,
    KIDNAPPING_LOG_ODDS,
    kidnapping_log_odds,
    with_kidnapping,
)
from gridslam.methods.ispace_mcl.search.relocalization import SEARCH, Relocalizer
from gridslam.methods.ispace_mcl.search.search_schedule import SearchSchedule
from gridslam.methods.ispace_mcl.step_matching import matched_step
from gridslam.methods.ispace_mcl.window import PastScan, ScanWindow
from gridslam.sensors.floor_cells import FloorCells
from gridslam.sensors.likelihood_field import distance_field
from gridslam.sensors.pose_search import PoseSearch
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.visibility import BeamSegments, VisibilityField
from tests.methods.ispace_mcl.building import BEAMS, LIDAR, building, drive, scan_at

NO_CELLS = FloorCells(np.zeros((0, 2), np.int64), 0.1)
SEEN = CameraObservation(NO_CELLS, NO_CELLS, np.zeros(3))


def _points(pose):
    grid = building()
    ranges = scan_at(grid, grid.probability > 0.5, np.asarray(pose))
    angles = -np.pi + 2.0 * np.pi / BEAMS * np.arange(BEAMS)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + LIDAR[:2]


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(0, 5))
def test_a_hypothesis_explains_all_scans_or_the_latest_ones_at_a_price(seed, scans, hypotheses):
    rng = np.random.default_rng(seed)
    others, own = rng.normal(-1.0, 1.0, (scans, hypotheses)), rng.normal(-1.0, 1.0, scans)
    prices = rng.uniform(0.0, 2.0, scans - 1)
    got, explained = with_kidnapping(others, own, prices)
    for k in range(hypotheses):
        choices = [others[:, k].sum()]
        choices += [others[:b, k].sum() + own[b:].sum() - prices[b - 1] for b in range(1, scans)]
        assert got[k] == pytest.approx(max(choices))
        assert explained[k] == (int(np.argmax(choices)) or scans)


def test_having_been_carried_costs_less_where_a_scan_does_not_continue_the_one_before_it():
    here, there = _points((-1.0, 3.8, 0.0)), _points((5.0, 8.5, 1.0))
    step = np.array([0.2, 0.0, 0.0])
    continued = overlap_of(here, _points((-0.8, 3.8, 0.0)), step)
    discontinuous = overlap_of(here, there, step)
    assert overlap_of(here, there[:5], step) == 1.0  # too few points to know
    prices = kidnapping_log_odds(np.array([continued, discontinuous]))
    assert prices.tolist() == [KIDNAPPING_LOG_ODDS, DISCONTINUOUS_LOG_ODDS]


def test_only_travel_of_a_confirmed_pose_counts_in_its_favour():
    schedule = SearchSchedule(has_start=False)
    schedule.assessed("localized", 0.9, 5.0)
    assert (schedule.is_trusted, schedule.prior_log_odds) == (False, 0.0)
    schedule.travel(5.0)
    schedule.confirm(is_confirmed=True, is_best=True)
    schedule.searched()
    schedule.assessed("localized", 0.9, 5.0)
    assert (schedule.is_trusted, schedule.prior_log_odds) == (True, 5.0)
    schedule.travel(5.0)
    assert not schedule.is_due("localized")
    schedule.assessed("localized", 0.7, 0.2)  # the scans agree less with the map than before
    assert schedule.is_due("localized")
    schedule.searched()
    schedule.assessed("uncertain", 0.7, 0.2)  # soon compared again, although it agrees with the map again
    schedule.travel(1.0)
    assert schedule.is_due("localized")
    schedule.confirm(is_confirmed=False, is_best=True)
    assert (schedule.is_trusted, schedule.is_best) == (False, True)
    assert schedule.prior_log_odds == pytest.approx(2.6)
    schedule.doubt()
    assert (schedule.is_trusted, schedule.is_best, schedule.prior_log_odds) == (False, False, 0.0)


def test_a_scan_matched_to_the_one_before_corrects_the_odometry():
    before, after = np.array([-1.0, 3.8, 0.1]), np.array([-0.6, 3.9, 0.3])
    truth = se2.between(before, after)
    guess = truth + np.array([0.12, -0.08, 0.1])
    found = matched_step(_points(before), _points(after), guess)
    assert np.hypot(*(found - truth)[:2]) < 0.08
    assert abs(found[2] - truth[2]) < 0.03


def test_a_step_without_matching_points_is_unchanged():
    step = np.array([0.3, 0.0, 0.1])
    np.testing.assert_array_equal(matched_step(_points((-1.0, 3.8, 0.1)), np.zeros((5, 2)), step), step)


def test_the_scans_of_the_window_are_aligned():
    path = drive([(-2.0, 3.8), (-0.5, 3.8), (-0.5, 5.8)])
    drifting = np.zeros(3)
    window = ScanWindow()
    for k, pose in enumerate(path):
        if k:
            step = se2.between(path[k - 1], pose)
            drifting = se2.compose(drifting, step * (1.1, 1.0, 1.1))
        window.add(drifting, LIDAR[:2], _points(pose))
    beams = window.recent(4.0, 300)
    assert len(beams) <= 300
    occupied = building().geometry.centres(np.argwhere(building().probability > 0.5))
    ends = se2.transform_points(path[-1], beams.endpoints)
    distances = np.sqrt(((ends[:, None] - occupied[None]) ** 2).sum(axis=2)).min(axis=1)
    assert np.median(distances) < 0.08
    assert np.mean(distances < 0.2) > 0.85


def test_scans_close_to_each_other_are_replaced():
    window = ScanWindow(min_step_m=0.4)
    for k in range(41):
        window.add(np.array([0.05 * k, 0.0, 0.0]), np.zeros(2), np.ones((3, 2)))
    assert 5 <= len(window) <= 7
    assert len(window.past(2)) == len(window)
    window.clear()
    assert len(window.recent(4.0, 10)) == 0


def test_what_the_cameras_saw_in_the_past_counts_for_the_pose_that_the_odometry_gives_then():
    grid = building()
    field = distance_field(grid.probability > 0.5, grid.geometry, 2.0)
    visibility = VisibilityField(field, range_caster(grid.probability > 0.5, grid.geometry), 0.4, 0.3)
    nothing, step = BeamSegments(np.zeros((0, 2)), np.zeros((0, 2))), np.array([1.5, 0.0, 0.0])
    search = PoseSearch(field, grid.probability < 0.3, SEARCH)
    relocalizer = Relocalizer(search, visibility, lambda seen, poses: len(seen) * poses[:, 0])
    past = [PastScan(step, nothing, nothing, ()), PastScan(step, nothing, nothing, (SEEN, SEEN))]
    scores = relocalizer.trace_back(np.array([[5.0, 2.0, 0.0], [5.0, 2.0, np.pi]]), past)
    np.testing.assert_allclose(scores, [[0.0, 0.0], [7.0, 13.0]])
    # The first pose follows those of the filter, unless the filter was elsewhere.
    for tracked, by_cameras in (([4.0, 2.0, 0.0], 8.0), ([9.0, 2.0, 0.0], 7.0)):
        known = [past[0], replace(past[1], tracked=np.array(tracked))]
        assert relocalizer.trace_back(np.array([[5.0, 2.0, 0.0]]), known)[1, 0] == pytest.approx(by_cameras)


def test_a_scan_that_is_replaced_leaves_its_observations_to_the_next_one():
    window = ScanWindow(min_step_m=0.4)
    for x, seen in ((0.0, []), (0.1, [SEEN]), (0.3, []), (1.0, [])):
        window.add(np.array([x, 0.0, 0.0]), np.zeros(2), np.ones((3, 2)), seen)
    (carried,) = [seen for scan in window.past(2) for seen in scan.observations]
    np.testing.assert_allclose(carried.T_now_then, [-0.9, 0.0, 0.0])


def test_along_a_corridor_the_odometry_says_how_far_and_the_scans_how_far_aside():
    rng = np.random.default_rng(3)

    def corridor(pose):  # two walls 2.2 m apart, seen up to 8 m by evenly spaced beams
        angles = np.linspace(-3.14, 3.14, 240)
        across = np.sin(angles + pose[2])
        ranges = np.where(across > 0.0, 1.1 - pose[1], -1.1 - pose[1]) / across
        points = np.column_stack([np.cos(angles), np.sin(angles)]) * ranges[:, None]
        return points[ranges < 8.0] + rng.normal(0.0, 0.01, (int((ranges < 8.0).sum()), 2))

    travel = []
    for _ in range(6):
        before, after = np.zeros(3), np.array([0.4, rng.normal(0.0, 0.05), rng.normal(0.0, 0.05)])
        guess = after + np.array([0.0, 0.04, 0.03])
        found = matched_step(corridor(before), corridor(after), guess)
        travel.append(found[0])
        assert abs(found[1] - after[1]) < 0.03
        assert abs(found[2] - after[2]) < 0.015
    assert np.mean(travel) == pytest.approx(0.4, abs=0.03)
