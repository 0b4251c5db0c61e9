"""Which localizations are not trusted, and what the user is asked to check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from gridslam.filters.particles import Belief
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ispace_mcl.confidence import (
    MAX_BESIDE_RATIO,
    MAX_LATE_RATIO,
    ConfidenceMonitor,
    InlierLimits,
)
from gridslam.methods.ispace_mcl.doubt import doubt_of
from gridslam.methods.ispace_mcl.scan_agreement import BLOCKED_TOLERANCE_M, GRAZING_SLACK_M
from gridslam.methods.ispace_mcl.travel_ratio import jumps_m
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field, occupied_cells
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.visibility import VisibilityField

WALLS = 0.65


@dataclass(frozen=True)
class FakeHistory:
    """What doubt_of asks for."""

    statuses: Sequence[str]
    displaced_ratios: Sequence[float]
    ratio: float = 1.0
    inlier_ratio: float = 0.7
    jumps: Sequence[float] = ()
    travel_m: float = 30.0
    is_contradicted: bool = False

    def localized_m(self) -> float:
        return self.travel_m

    @property
    def inlier_ratios(self) -> Sequence[float]:
        return [self.inlier_ratio] * len(self.statuses)

    @property
    def contradicted(self) -> Sequence[bool]:
        return [self.is_contradicted] * len(self.statuses)

    def travel_ratio(self) -> float:
        return self.ratio

    def jumps_m(self) -> np.ndarray:
        return np.array(self.jumps)


def room(negated: bool = False) -> OccupancyGrid:
    """A free room with a wall around it; negated, the walls are free and the room is a wall."""
    probability = np.full((40, 60), 0.95, np.float32)
    probability[1:-1, 1:-1] = 0.05
    return OccupancyGrid(1.0 - probability if negated else probability, GridGeometry(0.1, (0.0, 0.0)))


@pytest.mark.parametrize(
    "statuses",
    [
        ["lost"] * 10 + ["localized"] * 90,
        ["lost"] * 70 + ["localized"] * 30,  # found late, and held
        ["localized"] * 90 + ["uncertain"] * 10,  # people at the end
        [],
    ],
)
def test_a_robot_that_was_found_and_held_is_trusted(statuses: list[str]) -> None:
    assert doubt_of(FakeHistory(statuses, [0.01] * len(statuses)), room(), WALLS) is None


def test_a_robot_that_was_found_just_before_the_end_is_not_trusted() -> None:
    found = doubt_of(
        FakeHistory(["uncertain"] * 64 + ["localized"] * 36, [0.0] * 100, travel_m=4.1), room(), WALLS
    )
    assert found is not None
    assert found.reason.startswith("localized 36 % of the time, localized at the end")


@pytest.mark.parametrize(
    ("statuses", "line"),
    [
        (
            ["localized"] * 7 + ["lost"] * 93,
            "localized 7 % of the time, lost at the end; does this map belong",
        ),
        (["localized"] * 80 + ["lost"] * 20, "localized 80 % of the time, lost at the end"),
        (["uncertain"] * 100, "localized 0 % of the time, uncertain at the end"),
    ],
)
def test_a_robot_that_was_rarely_localized_or_lost_at_the_end_is_lost(statuses: list[str], line: str) -> None:
    doubt = doubt_of(FakeHistory(statuses, [0.01] * len(statuses)), room(), WALLS)
    assert doubt is not None
    assert doubt.status == "lost"
    assert doubt.reason.startswith(line)


def test_scans_that_fit_in_several_places_do_not_question_the_map() -> None:
    statuses = ["uncertain"] * 90 + ["localized"] * 10
    doubt = doubt_of(FakeHistory(statuses, [0.01] * 100, inlier_ratio=1.0), room(), WALLS)
    assert doubt is not None
    assert doubt.status == "lost"
    assert "more than one place" in doubt.reason
    assert "belong" not in doubt.reason


def test_scans_that_end_beside_or_behind_the_walls_question_the_map_although_they_end_near_them() -> None:
    history = FakeHistory(["uncertain"] * 100, [0.0] * 100, inlier_ratio=0.95, is_contradicted=True)
    doubt = doubt_of(history, room(), WALLS)
    assert doubt is not None
    assert "does this map belong to this place" in doubt.reason


def test_a_map_of_walls_is_suspected_to_be_negated() -> None:
    doubt = doubt_of(FakeHistory(["lost"] * 10, [0.0] * 10), room(negated=True), WALLS)
    assert doubt is not None
    assert "`negate`" in doubt.reason


@pytest.mark.parametrize(("ratio", "status"), [(0.02, None), (0.06, "inconsistent")])
def test_walls_that_beams_pass_a_little_are_doubted(ratio: float, status: str | None) -> None:
    statuses = ["lost"] * 10 + ["localized"] * 90
    doubt = doubt_of(FakeHistory(statuses, [0.5] * 10 + [ratio] * 90), room(), WALLS)
    assert (doubt.status if doubt else None) == status
    assert doubt is None or doubt.reason.startswith(
        "localized, but 6 % of the beams at walls end behind them"
    )


@pytest.mark.parametrize(
    ("far_x_m", "shortened", "expected"), [(5.9, False, 0.0), (6.1, False, 0.14), (5.9, True, 0.0)]
)
def test_only_a_wall_that_stands_farther_off_displaces_beams(
    far_x_m: float, shortened: bool, expected: float
) -> None:
    """Beams all around from (3, 2) in a room of 0.1 to 5.9 m by 0.1 to 3.9 m, whose right wall is seen at `far_x_m`.

    That wall takes 63 of 360 degrees; beams near its ends graze the other walls and say nothing.
    """
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    to_side = np.where(np.cos(bearings) > 0.0, far_x_m - 3.0, 2.9) / np.maximum(
        np.abs(np.cos(bearings)), 1e-9
    )
    ranges = np.minimum(to_side, 1.9 / np.maximum(np.abs(np.sin(bearings)), 1e-9))
    ranges = np.where(shortened & (np.abs(bearings) < 0.5), ranges - 0.3, ranges)
    points = ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    beams = Beams(ranges, bearings, np.ones(360, np.bool_), points, np.zeros(3), 10.0, 0)
    occupied = occupied_cells(room(), WALLS)
    field = distance_field(occupied, room().geometry, 2.0)
    visibility = VisibilityField(
        field, range_caster(occupied, room().geometry), BLOCKED_TOLERANCE_M, GRAZING_SLACK_M
    )
    monitor = ConfidenceMonitor(InlierLimits(0.55, 0.8), visibility)
    belief = Belief(np.array([3.0, 2.0, 0.0]), 1e-4 * np.eye(3), 1.0)
    step = np.array([0.3, 0.0, 0.0])
    assert monitor.assess(belief, beams, step).displaced_ratio == pytest.approx(expected, abs=0.035)
    assert monitor.assess(belief, beams, step).beside_ratio < 0.1
    assert monitor.assess(belief, beams, step).is_contradicted == (expected > MAX_LATE_RATIO)
    aside = Belief(np.array([2.82, 1.82, 0.0]), 1e-4 * np.eye(3), 1.0)
    for _ in range(20):
        found = monitor.assess(aside, beams, step)
    assert found.beside_ratio > MAX_BESIDE_RATIO


def test_places_that_the_odometry_does_not_connect_are_inconsistent() -> None:
    assert doubt_of(FakeHistory(["localized"] * 100, [0.0] * 100, jumps=[17.0]), room(), WALLS) is None
    doubt = doubt_of(FakeHistory(["localized"] * 100, [0.0] * 100, jumps=[17.0, 4.0]), room(), WALLS)
    assert doubt is not None
    assert (doubt.status, "3 places" in doubt.reason, "17 m" in doubt.reason) == ("inconsistent", True, True)


def test_a_jump_is_what_neither_the_odometry_nor_its_drift_explains() -> None:
    odometry = np.column_stack([np.arange(60.0), np.zeros(60), np.zeros(60)])
    poses = odometry + np.array([5.0, -2.0, 0.0])
    localized = np.ones(60, np.bool_)
    localized[20:40] = False
    assert len(jumps_m(poses, odometry, localized)) == 0
    poses[40:] += [0.0, 3.0, 0.0]  # after 21 m, within what odometry drifts
    assert len(jumps_m(poses, odometry, localized)) == 0
    poses[50:] += [0.0, 3.0, 0.0]
    np.testing.assert_allclose(jumps_m(poses, odometry, localized), [3.0])


def test_travel_that_differs_from_the_odometry_is_inconsistent() -> None:
    doubt = doubt_of(FakeHistory(["localized"] * 100, [0.0] * 100, 1.25), room(), WALLS)
    assert doubt is not None
    assert doubt.status == "inconsistent"
    assert "1.25 times as far on the map as by its odometry" in doubt.reason


def test_a_map_that_the_mirror_image_fits_better_is_inconsistent() -> None:
    doubt = doubt_of(FakeHistory(["localized"] * 100, [0.0] * 100), room(), WALLS, is_map_mirrored=True)
    assert doubt is not None
    assert doubt.status == "inconsistent"
    assert "mirror" in doubt.reason
