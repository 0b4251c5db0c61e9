"""What matching without odometry may have slipped by widens the search for loops along corridors only."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.lidar_slam.config import OdometryConfig
from gridslam.lidar_slam.front_end import ScanMatch
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.odometry_noise import odometry_std, unscanned_std
from gridslam.lidar_slam.slips import SLIP_M2_PER_M, UNMATCHED_MPS, slip_variances

STEP = np.array([0.2, 0.0, 0.0])


def match(weakest: tuple[float, float] | None, yaw_rad: float = 0.0) -> ScanMatch:
    return ScanMatch(np.array([3.0, 1.0, yaw_rad]), 0.9, True, None if weakest is None else np.array(weakest))


def test_a_match_that_is_certain_in_all_directions_has_not_slipped() -> None:
    assert slip_variances(STEP, 0.2, match((0.005, 0.005))).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("yaw_rad", "along"), [(0.0, 0), (0.5 * np.pi, 1), (np.pi, 0)])
def test_along_a_corridor_a_match_may_slip_in_the_corridors_direction(yaw_rad: float, along: int) -> None:
    variances = slip_variances(STEP, 0.2, match((-0.05, 0.0), yaw_rad))
    assert variances[along] == pytest.approx(SLIP_M2_PER_M * 0.2)
    assert variances[1 - along] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("found", [match(None), match((0.005, 0.0))])
def test_after_a_gap_and_without_a_match_a_step_may_be_off_in_any_direction(found: ScanMatch) -> None:
    assert slip_variances(STEP, 3.0, found).tolist() == [UNMATCHED_MPS**2, UNMATCHED_MPS**2, 0.0]


def test_slips_add_to_the_drift_of_their_steps() -> None:
    track = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    slips = np.array([[9.0, 9.0, 9.0], [0.5, 0.0, 0.0], [0.0, 0.25, 0.01]])
    plain, slipped = (model.cumulative_variances(track) for model in (DriftModel(), DriftModel(slips=slips)))
    assert slipped - plain == pytest.approx(np.array([[0.0, 0, 0], [0.5, 0, 0], [0.5, 0.25, 0.01]]))


def test_a_long_step_by_odometry_alone_is_uncertain_in_position_and_heading() -> None:
    assert unscanned_std(np.array([1.0, 0.0, 1.0])).tolist() == [0.0, 0.0, 0.0]
    long = np.array([-16.0, 12.0, 2.0])
    assert unscanned_std(long) == pytest.approx([2.0, 2.0, 0.3])
    assert odometry_std(long, np.zeros(3), OdometryConfig()) == pytest.approx([2.0, 2.0, 0.3])
