"""The time of a sweep is found where the messages leave it out or have the wrong sign, and only there."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import Event, LaserScan, Transform
from gridslam.lidar_slam.sensor_checks.sweep_calibration import (
    SweepTime,
    _other_than_stated,
    find_sweep_time,
    with_sweep,
)
from gridslam.logs.open import open_log
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import _tracker_of
from tests.benchmarks.input_kinds import ORDINARY, drive
from tests.conftest import REPOSITORY

LOG = REPOSITORY / "sample_logs" / "slam-sd.mcap"
TRUE_SWEEP_S = 0.05  # of configs/worlds/office.yaml
SCANS = 300


@cache
def events() -> tuple[Event, ...]:
    with open_log(LOG) as log:
        found = [event for event in log.events() if isinstance(event, LaserScan | Transform)]
    return tuple(found[:SCANS])


def found_with(sweep_s: float, scans: int = SCANS) -> SweepTime | None:
    """What is found when all scans state this time."""
    stated = [with_sweep(e, sweep_s) if isinstance(e, LaserScan) else e for e in events()[:scans]]
    build = partial(_tracker_of, SlamSdConfig())
    tracker = build()
    for event in stated:
        for placed in tracker.process(event):
            tracker.track_scan(placed)
    for placed in tracker.flush():
        tracker.track_scan(placed)
    return find_sweep_time(stated, tracker, build)


def test_times_that_are_right_are_kept() -> None:
    assert found_with(TRUE_SWEEP_S) is None


def test_times_that_are_left_out_are_found_by_the_robots_turns() -> None:
    found = found_with(0.0)
    assert found is not None
    assert found.sweep_s == pytest.approx(TRUE_SWEEP_S, abs=0.02)
    assert "say nothing of the time of their beams" in found.note


def test_times_with_the_wrong_sign_are_reversed() -> None:
    found = found_with(-TRUE_SWEEP_S)
    assert found is not None
    assert found.sweep_s == pytest.approx(TRUE_SWEEP_S)


class PeakedTrials:
    """Inlier ratios that are largest with the true time of a sweep."""

    def ratios(self, sweep_s: float) -> np.ndarray:
        return np.full(50, 0.9 - 40.0 * (sweep_s - TRUE_SWEEP_S) ** 2)


@pytest.mark.parametrize("factor", [-1.0, -0.5, 0.5, 2.0])
def test_another_time_is_tried_where_the_stated_one_is_not_near_the_best(factor: float) -> None:
    found = _other_than_stated(PeakedTrials(), factor * TRUE_SWEEP_S, 0.1)  # type: ignore[arg-type]
    assert found == pytest.approx(TRUE_SWEEP_S, abs=0.005)


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.15])
def test_a_stated_time_near_the_best_is_kept(factor: float) -> None:
    assert _other_than_stated(PeakedTrials(), factor * TRUE_SWEEP_S, 0.1) is None  # type: ignore[arg-type]


def test_few_turns_show_no_time() -> None:
    assert found_with(0.0, scans=80) is None


def test_right_times_of_a_narrow_lidar_are_kept(tmp_path: Path) -> None:
    """With this seed scans match as well in the other direction, which once took the path 0.035 m off."""
    with open_log(ORDINARY["ordinary_narrow"](drive(2), tmp_path / "narrow.mcap")) as log:
        seen = [e for e in log.events() if isinstance(e, LaserScan | Transform)][:500]
    build = partial(_tracker_of, SlamSdConfig())
    tracker = build()
    tracker.track_all(seen)
    assert find_sweep_time(seen, tracker, build) is None
