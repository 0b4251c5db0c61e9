from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.core.messages import AbsolutePose, Event, Imu, Odometry, Range, WheelTicks, readonly
from gridslam.evaluation.map_errors import wall_distances
from gridslam.logs.open import open_log
from gridslam.maps.map_server import load_map
from gridslam.methods.base import RunResult
from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.method import IrScanLocalizer, IrScanMapper
from gridslam.runs.run_config import load_config
from tests.conftest import REPOSITORY
from tests.methods.ir_scan.room import BEARINGS, STOPS, events

SAMPLES = REPOSITORY / "sample_logs"
LOG = list(events())


def config(name: str = "ir-scan", *overrides: str) -> IrScanConfig:
    method = load_config(name, overrides).method
    assert isinstance(method, IrScanConfig)
    return method


def run(log: Iterable[Event], settings: IrScanConfig | None = None) -> RunResult:
    method = IrScanMapper(settings or config(), 0)
    for event in log:
        method.process(event)
    return method.result()


def stops_of(result: RunResult) -> NDArray[np.float64]:
    return np.array([row[1:4] for row in result.tables["stops"].rows], dtype=np.float64)


def true_stops() -> NDArray[np.float64]:
    return se2.between(STOPS[:1], STOPS)


def sample(name: str) -> list[Event]:
    run_config = load_config("ir-scan")
    with open_log(SAMPLES / name, run_config.log, ("range", "odom", "wheels", "imu", "pose")) as log:
        return list(log.events())


@pytest.mark.parametrize(("name", "bound_m"), [("ir-scan", 0.015), ("paper/ir-scan", 0.1)])
def test_stops_are_localized_and_every_reading_is_counted(name: str, bound_m: float) -> None:
    result = run(LOG, config(name))
    assert np.hypot(*(stops_of(result) - true_stops())[:, :2].T).max() < bound_m
    counters = result.counters
    skipped = sum(n for key, n in counters.items() if key.startswith("skipped.range."))
    assert counters["used.range"] + skipped == sum(isinstance(event, Range) for event in LOG)
    assert counters["scans"] == len(STOPS)


def test_odometry_alone_is_worse_than_with_matching() -> None:
    alone = run(LOG, config("ir-scan", "method.matching={kind: none}", "method.adjustment.enabled=false"))
    assert stops_of(alone)[-1, 0] - true_stops()[-1, 0] == pytest.approx(0.02 * 2.0, abs=1e-6)
    assert alone.measures["matches"] == {"off": len(STOPS)}


def test_the_result_has_map_pos_grid_picture_table_and_series() -> None:
    result = run(LOG)
    assert result.occupancy is not None
    assert set(result.layers) == {"pos"}
    assert result.layers["pos"].values.dtype == np.float64
    assert set(result.pictures) == {"raw_and_filtered"}
    assert result.pictures["raw_and_filtered"].rgb.shape[2] == 3
    assert set(result.series) == {"correction", "heading_correction", "reliable_readings"}
    assert np.diff(result.trajectory.stamps_ns).min() > 0
    assert len(result.trajectory) > 200


def test_the_papers_map_is_the_pos_grid() -> None:
    result = run(LOG, config("paper/ir-scan"))
    assert result.occupancy is not None
    pos = result.layers["pos"].values
    p = result.occupancy.probability
    assert np.array_equal(pos > 0, p > 0.65)
    assert np.array_equal(pos < 0, p < 0.196)
    assert np.array_equal(pos == 0, np.isnan(p))


def test_scans_enter_the_map_with_a_delay_and_all_are_in_it_at_the_end() -> None:
    delayed = run(LOG, config("paper/ir-scan", "method.advanced.matching.delay_stops=3"))
    verdicts = [row[9] for row in delayed.tables["stops"].rows]
    assert verdicts[:4] == ["first"] * 4
    assert "first" not in verdicts[4:]
    never = "method.advanced.matching.min_points=10000"  # no correction: the same poses
    grids = [
        run(LOG, config("paper/ir-scan", never, f"method.advanced.matching.delay_stops={stops}"))
        .layers["pos"]
        .values
        for stops in (0, 3, 100)
    ]
    assert np.allclose(grids[0], grids[1])
    assert np.allclose(grids[0], grids[2])


def test_the_sample_logs_give_the_same_accurate_map_in_both_formats() -> None:
    mcap, csv = run(sample("ir-scan.mcap")), run(sample("ir-scan-csv"))
    assert mcap.occupancy is not None
    assert csv.occupancy is not None
    assert mcap.occupancy.probability.tobytes() == csv.occupancy.probability.tobytes()
    assert mcap.trajectory.poses.tobytes() == csv.trajectory.poses.tobytes()
    truth = load_map(SAMPLES / "ir-scan.truth" / "map.yaml")
    walls = wall_distances(mcap.occupancy, truth, np.array([0.8, 0.75, 0.0]))
    assert walls.accuracy.mean() < 0.015
    assert walls.accuracy.var() < 4e-4
    assert walls.accuracy.max() < 0.1


def test_wheel_angles_are_as_good_as_odometry_if_the_wheels_are_known() -> None:
    log = sample("ir-scan.mcap")
    by_odometry = stops_of(run(log))
    wheels = config("ir-scan", "method.motion.wheel_radius_m=0.035", "method.motion.wheel_base_m=0.2")
    by_wheels = stops_of(run([event for event in log if not isinstance(event, Odometry)], wheels))
    assert np.hypot(*(by_wheels - by_odometry)[:, :2].T).max() < 0.005


def test_the_map_starts_at_a_given_start_pose() -> None:
    start = [4.0, -2.0, 1.2]
    moved = stops_of(run(LOG, config("ir-scan", f"method.start={start}")))
    assert np.allclose(se2.between(np.array(start), moved), stops_of(run(LOG)), atol=0.008)


@pytest.mark.parametrize("name", ["ir-scan", "paper/ir-scan"])
def test_the_robot_is_localized_on_a_given_map_from_a_wrong_start(name: str) -> None:
    occupancy = run(LOG).occupancy
    assert occupancy is not None
    settings = config(name, "method.start=[0.04, -0.03, 0.02]", "method.advanced.matching.min_points=20")
    localizer = IrScanLocalizer(settings, 0, occupancy)
    for event in events(seed=5):
        localizer.process(event)
    result = localizer.result()
    assert result.occupancy is None
    off = (stops_of(result) - true_stops())[1:, :2]
    assert np.hypot(*off.T).max() < (0.02 if name == "ir-scan" else 0.08)


def damaged(log: Iterable[Event], seed: int = 0) -> Iterator[Event]:
    """Readings with wild angles, invalid and infinite values, duplicates, and a sensor that fails during the drive."""
    rng = np.random.default_rng(seed)
    ranges = 0
    for event in log:
        if not isinstance(event, Range):
            yield event
            continue
        ranges += 1
        draw = rng.random()
        if event.frame_id == "left" and ranges > 900:
            continue
        if draw < 0.01:
            event = replace(event, bearing_rad=float(rng.uniform(-3.0, 3.0)))
        elif draw < 0.05:
            event = replace(event, range_m=float(rng.choice([0.0, -1.0, math.inf, math.nan, 1e30])))
        elif draw < 0.06:
            event = replace(event, bearing_rad=math.nan)
        yield event
        if 0.06 < draw < 0.09:
            yield event


def test_a_damaged_stream_of_readings_is_counted_and_changes_little() -> None:
    log = list(damaged(LOG))
    result = run(log)
    assert np.hypot(*(stops_of(result)[-1] - true_stops()[-1])[:2]) < 0.02
    for reason in ("bad_bearing", "duplicate", "out_of_limits"):
        assert result.counters[f"skipped.range.{reason}"] > 0
    assert result.counters["scan.missing_sensor"] > 0
    skipped = sum(n for key, n in result.counters.items() if key.startswith("skipped.range."))
    assert result.counters["used.range"] + skipped == sum(isinstance(event, Range) for event in log)


def test_scans_without_a_valid_reading_or_with_one_sample_follow_odometry() -> None:
    blind = [replace(e, range_m=9.0) if isinstance(e, Range) else e for e in LOG]
    result = run(blind)
    assert result.counters["scan.all_invalid"] == len(STOPS)
    assert result.measures["matches"] == {"too_few_points": len(STOPS)}
    assert result.occupancy is not None
    assert result.occupancy.probability.size == 0
    first = [
        e for e in LOG if not isinstance(e, Range) or (e.frame_id, e.bearing_rad) == ("right", BEARINGS[0])
    ]
    lone = run(first)
    assert lone.counters["scan.one_sample"] == len(STOPS)
    assert "used.range" not in lone.counters


def test_no_readings_and_no_events_give_an_empty_result() -> None:
    assert len(run([]).trajectory) == 0
    no_ranges = run([event for event in LOG if not isinstance(event, Range)])
    assert no_ranges.measures["stops"] == 0
    assert len(no_ranges.trajectory) > 100


def test_a_log_without_any_motion_is_refused() -> None:
    with pytest.raises(MethodError, match="the robot's pose is unknown"):
        run(event for event in LOG if not isinstance(event, (Odometry, Imu)))
    only_wheels = [
        WheelTicks(e.stamp_ns, "base_link", e.x_m, e.x_m) if isinstance(e, Odometry) else e for e in LOG
    ]
    with pytest.raises(MethodError, match="wheel_radius_m"):
        run(only_wheels)


def test_odometry_that_is_not_finite_or_jumps_is_counted() -> None:
    count = 0
    log: list[Event] = []
    for event in LOG:
        if isinstance(event, Odometry):
            count += 1
            if count == 300:
                event = replace(event, x_m=math.nan)
            elif count > 400:
                event = replace(event, x_m=event.x_m + 100.0)
        log.append(event)
    result = run(log)
    assert result.counters["skipped.odom.not_finite"] == 1
    assert result.counters["odom.jumps"] == 1
    assert np.hypot(*(stops_of(result)[-1] - true_stops()[-1])[:2]) < 0.05


def with_absolute_poses(offset: NDArray[np.float64], std: float) -> Iterator[Event]:
    """An absolute pose before every stop and no odometry; `offset` `(n, 3)` is the error of the poses."""
    stop = -1
    last = -(10**9)
    for event in LOG:
        if isinstance(event, Range):
            if event.stamp_ns - last > 200_000_000:
                stop += 1
                pose = STOPS[stop] + offset[stop]
                covariance = np.diag([std**2, std**2, 1e-4])
                yield AbsolutePose(
                    event.stamp_ns, "map", readonly(pose, np.float64), readonly(covariance, np.float64)
                )
            last = event.stamp_ns
        if not isinstance(event, (Odometry, Imu)):
            yield event


def test_without_odometry_stops_are_at_absolute_poses_and_matching_corrects_them() -> None:
    given = run(
        with_absolute_poses(np.zeros((9, 3)), 0.001), config("ir-scan", "method.matching={kind: none}")
    )
    assert np.hypot(*(stops_of(given) - STOPS)[:, :2].T).max() < 0.002
    off = np.random.default_rng(0).uniform(-0.04, 0.04, (9, 3)) * [1.0, 1.0, 0.1]
    off[0] = 0.0
    matched = stops_of(run(with_absolute_poses(off, 0.03)))
    before, after = np.hypot(*off[:, :2].T), np.hypot(*(matched - STOPS)[:, :2].T)
    assert after.mean() < 0.5 * before.mean()


def test_with_odometry_absolute_poses_are_fused_and_outliers_rejected() -> None:
    covariance = readonly(np.diag([0.01, 0.01, 0.01]) ** 2, np.float64)
    log: list[Event] = []
    count = 0
    for event in LOG:
        log.append(event)
        if isinstance(event, Odometry):
            count += 1
            if count % 40 == 0:
                pose = np.array([0.5 + event.x_m / 1.02, 3.6 if count % 200 == 0 else 0.6, 0.0])
                log.append(AbsolutePose(event.stamp_ns, "map", readonly(pose, np.float64), covariance))
    result = run(log)
    assert result.counters["skipped.pose.outlier"] > 0
    assert result.counters["used.pose"] > 10
    assert np.hypot(*(stops_of(result) - STOPS)[:, :2].T).max() < 0.015


def test_two_runs_give_the_same_bytes() -> None:
    one, two = run(LOG), run(LOG)
    assert one.occupancy is not None
    assert two.occupancy is not None
    assert one.occupancy.probability.tobytes() == two.occupancy.probability.tobytes()
    assert one.trajectory.poses.tobytes() == two.trajectory.poses.tobytes()
    assert one.pictures["raw_and_filtered"].rgb.tobytes() == two.pictures["raw_and_filtered"].rgb.tobytes()
