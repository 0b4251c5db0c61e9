"""What people, new things, other walls and other places leave of the agreement of scans with the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.messages import LaserScan, readonly
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.methods.ispace_mcl.scan_agreement import (
    BLOCKED_TOLERANCE_M,
    GRAZING_SLACK_M,
    MIN_TRAVEL_M,
    MapEvidence,
    ScanAgreement,
    agreement_of,
)
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.visibility import VisibilityField
from tests.methods.ispace_mcl.building import BEAMS, LIDAR, ROUND_TRIP, building, record, scan_at

POSE = np.array([2.0, 3.8, 0.3])
STEP = np.array([0.25, 0.0, 0.0])


def agreement(seen: np.ndarray, grid: OccupancyGrid) -> ScanAgreement:
    """The agreement of a scan with ranges `(BEAMS,)` at POSE with a map."""
    occupied = grid.probability > 0.5
    bearings = -np.pi + 2.0 * np.pi / BEAMS * np.arange(BEAMS)
    points = seen[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)]) + LIDAR[:2]
    beams = Beams(seen, bearings, np.ones(BEAMS, np.bool_), points, LIDAR, 20.0, 0)
    field = distance_field(occupied, grid.geometry, 2.0)
    visibility = VisibilityField(
        field, range_caster(occupied, grid.geometry), BLOCKED_TOLERANCE_M, GRAZING_SLACK_M
    )
    return agreement_of(beams, POSE, field.distances_at(points, POSE), visibility)


def true_ranges() -> np.ndarray:
    """What the lidar measures at POSE in the building of the map."""
    grid = building()
    return scan_at(grid, grid.probability > 0.5, POSE)


def is_consistent(seen: ScanAgreement) -> bool:
    """Whether a drive with such scans alone is consistent."""
    evidence = MapEvidence()
    for k in range(20):
        evidence.add(seen, POSE + k * STEP, STEP * [np.cos(POSE[2]), -np.sin(POSE[2]), 0.0])
    return evidence.is_consistent


def test_people_in_front_of_walls_do_not_contradict_the_map() -> None:
    ranges = true_ranges()
    hidden = np.arange(BEAMS) % 10 < 5
    found = agreement(np.where(hidden, np.minimum(ranges, 0.9), ranges), building())
    assert found.inliers < 0.75
    assert found.early > 0.3
    assert found.late + found.passing < 0.02
    assert is_consistent(found)


@pytest.mark.parametrize(("behind_m", "name"), [(0.35, "late"), (1.5, "passing")])
def test_beams_that_end_behind_walls_contradict_the_map(behind_m: float, name: str) -> None:
    ranges = true_ranges()
    found = agreement(np.where(np.arange(BEAMS) % 10 < 2, ranges + behind_m, ranges), building())
    assert getattr(found, name) > 0.04
    assert not is_consistent(found)


def test_scans_that_people_hide_nearly_whole_show_no_place() -> None:
    found = agreement(np.where(np.arange(BEAMS) % 10 < 8, 0.6, true_ranges()), building())
    assert found.late + found.passing < 0.02
    assert not is_consistent(found)


def test_an_estimate_that_leaves_the_odometry_has_to_be_consistent_anew() -> None:
    good, evidence = agreement(true_ranges(), building()), MapEvidence()
    at = np.zeros(3)
    while not evidence.is_consistent:
        evidence.add(good, at, STEP)
        at = at + STEP
    assert MIN_TRAVEL_M <= at[0] <= MIN_TRAVEL_M + 0.5
    evidence.add(good, at + 3.0 * STEP / STEP[0], STEP)
    assert not evidence.is_consistent


def test_a_robot_among_people_is_localized() -> None:
    """People who walk around the robot hide 40 % of its view, up to 3 m."""
    rng = np.random.default_rng(4)
    bearings = rng.random(6)
    log = []
    for event in record(building(), ROUND_TRIP, seed=11):
        if isinstance(event, LaserScan):
            bearings = (bearings + rng.normal(0.0, 0.02, 6)) % 1.0
            ranges, beams = event.ranges_m.copy(), np.arange(BEAMS) / BEAMS
            for bearing in bearings:
                hidden = (beams - bearing) % 1.0 < 0.4 / 6
                ranges[hidden] = np.minimum(ranges[hidden], rng.uniform(0.6, 3.0))
            event = replace(event, ranges_m=readonly(ranges, np.float32))
        log.append(event)
    method = IspaceMcl(IspaceMclConfig(), 0, building())
    for event in log:
        method.process(event)
    result = method.result()
    away = np.hypot(*(result.trajectory.poses - ROUND_TRIP)[:, :2].T)
    called = np.array([row[-1] == "localized" for row in result.tables["localization"].rows])
    assert away[called].max() < 0.5
    assert called.mean() > 0.6
    assert result.doubt is None
