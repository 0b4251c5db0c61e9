from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.messages import LaserScan, Odometry
from gridslam.kernels.threads import on_threads
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ispace_mcl.config import GlobalSearchConfig, IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.runs.run_config import load_config
from tests.methods.ispace_mcl.building import ROUND_TRIP, building, record

MAP = building()
LOG = record(MAP, ROUND_TRIP, seed=7)
START = tuple(ROUND_TRIP[0])


def run(config, log=LOG, seed=0, grid=MAP):
    method = IspaceMcl(config, seed, grid)
    for event in log:
        method.process(event)
    return method.result()


def errors(result, path=ROUND_TRIP):
    """Distances (m) and angles (rad) to the true path."""
    off = result.trajectory.poses - path
    return np.hypot(off[:, 0], off[:, 1]), np.abs(se2.wrap_angle(off[:, 2]))


def test_a_robot_with_a_start_pose_is_tracked():
    result = run(IspaceMclConfig(start=START))
    away, turned = errors(result)
    assert away.max() < 0.25
    assert np.sqrt(np.mean(away**2)) < 0.08
    assert turned.max() < 0.1
    assert result.counters.get("injections", 0) == 0


@pytest.mark.parametrize("seed", range(2))
def test_a_robot_without_a_start_pose_is_found(seed):
    result = run(IspaceMclConfig(), seed=seed)
    away, turned = errors(result)
    late = len(away) // 4
    assert away[late:].max() < 0.25
    assert turned[late:].max() < 0.1


@pytest.mark.parametrize("seed", range(2))
def test_a_wrong_start_pose_is_noticed_and_corrected(seed):
    config = IspaceMclConfig(start=(5.0, 8.5, 1.0), start_std=(0.1, 0.1, 0.05))
    result = run(config, seed=seed)
    away, _ = errors(result)
    assert result.counters["injections"] >= 1
    assert away[len(away) // 3 :].max() < 0.25
    assert result.series["confidence"].values[-1] > 0.7


def test_the_papers_estimate_is_the_mean_of_all_particles_and_changes_nothing_else():
    settings = {"start": START, "start_std": (1.0, 1.0, 0.5), "search": GlobalSearchConfig(enabled=False)}
    cluster, mean = (run(IspaceMclConfig(estimate=e, **settings), log=LOG[:120]) for e in ("cluster", "mean"))
    std, std_of_all = (mean.series[f"particle_std{name}"].values for name in ("", "_all"))
    assert np.array_equal(std, std_of_all)
    assert np.array_equal(std_of_all, cluster.series["particle_std_all"].values)
    assert cluster.series["particle_std"].values[0] < 0.9 * std[0]
    assert np.array_equal(mean.series["confidence"].values, cluster.series["confidence"].values)
    assert not np.array_equal(mean.trajectory.poses[0], cluster.trajectory.poses[0])
    assert errors(mean, ROUND_TRIP[: len(mean.trajectory)])[0][-1] < 0.25
    assert load_config("paper/ispace-mcl").method.estimate == "mean"


def test_a_start_pose_off_the_map_is_refused():
    with pytest.raises(ConfigError, match=r"method\.start: \(1e\+09, 2\) lies off the map"):
        IspaceMcl(IspaceMclConfig(start=(1e9, 2.0, 0.0)), 0, MAP)


def test_a_robot_that_is_carried_away_is_found_again():
    half = len(ROUND_TRIP) // 2
    path = np.concatenate([ROUND_TRIP[: half - 30], ROUND_TRIP[half + 30 :]])
    log = record(MAP, path, seed=9)
    # The odometry does not know of the jump: its frame is shifted so that it goes on as if nothing had happened.
    cut = half - 30
    odometry = [event for event in log if isinstance(event, Odometry)]
    before, after = odometry[cut - 1], odometry[cut]
    shift = se2.compose(before.pose, se2.inverse(after.pose))
    calm = []
    for event in log:
        if isinstance(event, Odometry) and event.stamp_ns >= after.stamp_ns:
            x, y, yaw = (float(v) for v in se2.compose(shift, event.pose))
            event = replace(event, x_m=x, y_m=y, yaw_rad=yaw)
        calm.append(event)
    result = run(IspaceMclConfig(start=START), calm)
    away, _ = errors(result, path)
    assert away[:cut].max() < 0.3
    assert away[-20:].max() < 0.3
    lost = [row[-1] for row in result.tables["localization"].rows[cut : cut + 30]]
    assert "lost" in lost


def test_a_jump_of_the_odometry_is_counted_and_survived():
    middle = LOG[len(LOG) // 2].stamp_ns
    log = [
        replace(event, x_m=event.x_m + 30.0)
        if isinstance(event, Odometry) and event.stamp_ns >= middle
        else event
        for event in LOG
    ]
    result = run(IspaceMclConfig(start=START), log)
    assert result.counters["odometry.jumps"] == 1
    assert errors(result)[0][-20:].max() < 0.25


def test_every_scan_has_a_pose_at_its_stamp_and_a_row_in_the_table():
    result = run(IspaceMclConfig(start=START))
    stamps = [event.stamp_ns for event in LOG if isinstance(event, LaserScan)]
    assert result.trajectory.stamps_ns.tolist() == stamps
    table = result.tables["localization"]
    assert len(table.rows) == len(stamps)
    assert tuple(table.columns) == (
        "stamp", "x", "y", "yaw", "var_x", "var_y", "var_yaw",
        "confidence", "inlier_ratio", "std", "std_all", "n_particles", "status",
    )  # fmt: skip
    assert table.rows[3][0] == "1000000000.300000000"
    assert {row[-1] for row in table.rows} <= {"localized", "uncertain", "lost"}
    assert all(1000 <= row[-2] <= 10_000 for row in table.rows)
    assert set(result.series) >= {"confidence", "inlier_ratio", "particle_std"}
    assert result.counters["used.scan"] == len(stamps)


def test_same_seed_same_numbers_on_any_number_of_threads():
    first = run(IspaceMclConfig(), LOG[:80], seed=3).trajectory.poses
    with on_threads(1):
        second = run(IspaceMclConfig(), LOG[:80], seed=3).trajectory.poses
    np.testing.assert_array_equal(first, second)
    other = run(IspaceMclConfig(), LOG[:80], seed=4).trajectory.poses
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("weight", ["likelihood-field", "beam", "range-difference"])
def test_every_model_of_the_lidar_tracks(weight):
    config = IspaceMclConfig(start=START, weight=weight, search=GlobalSearchConfig(enabled=False))
    away, _ = errors(run(config, LOG[:201]), ROUND_TRIP[:100])
    assert away.max() < 0.3


def test_a_rotated_map_gives_the_same_path_rotated():
    yaw = 0.6
    corner = se2.compose([1.0, 2.0, yaw], [*MAP.geometry.origin_xy_m, 0.0])
    grid = OccupancyGrid(MAP.probability, GridGeometry(0.1, (float(corner[0]), float(corner[1])), yaw))
    result = run(IspaceMclConfig(), grid=grid)
    away, turned = errors(result, se2.compose([1.0, 2.0, yaw], ROUND_TRIP))
    late = len(away) // 4
    assert away[late:].max() < 0.25
    assert turned[late:].max() < 0.1


def test_a_robot_in_another_building_is_not_believed_to_be_localized():
    rng = np.random.default_rng(0)
    probability = np.where(rng.random((80, 120)) < 0.01, 0.95, 0.05).astype(np.float32)
    result = run(IspaceMclConfig(), LOG[:200], grid=OccupancyGrid(probability, MAP.geometry))
    assert np.median(result.series["confidence"].values) < 0.3
    assert result.doubt is not None
    assert "does this map belong to this place" in result.doubt.reason


def test_a_map_of_half_the_resolution_makes_the_result_lost():
    half = OccupancyGrid(MAP.probability, GridGeometry(0.05, MAP.geometry.origin_xy_m))
    result = run(IspaceMclConfig(), LOG[:200], grid=half)
    assert result.doubt is not None
    assert result.doubt.status == "lost"


def test_a_negated_map_makes_the_result_lost_and_is_named_as_the_cause():
    result = run(IspaceMclConfig(), LOG[:120], grid=OccupancyGrid(1.0 - MAP.probability, MAP.geometry))
    assert result.doubt is not None
    assert "`negate`" in result.doubt.reason


def test_a_robot_that_is_found_is_not_doubted():
    assert run(IspaceMclConfig(start=START), LOG[:200]).doubt is None


def test_beams_that_cannot_be_used_and_changing_beam_counts_are_counted():
    log = []
    for k, event in enumerate(LOG[:60]):
        if isinstance(event, LaserScan) and k % 3 == 0:
            ranges = np.full(40, np.nan, np.float32)
            event = replace(event, ranges_m=ranges)
        log.append(event)
    result = run(IspaceMclConfig(start=START), log)
    assert result.counters["beams.unreadable"] > 0
    assert result.counters["scan.without_returns"] > 0
    assert result.counters["scan.beam_count_changes"] > 0
    assert len(result.trajectory) == sum(isinstance(event, LaserScan) for event in log)


def test_a_log_without_scans_gives_an_empty_result():
    result = run(IspaceMclConfig(), [event for event in LOG[:20] if not isinstance(event, LaserScan)])
    assert len(result.trajectory) == 0
    assert result.tables["localization"].rows == []


def test_odometry_with_a_mirrored_yaw_is_used_corrected():
    mirrored = [replace(e, yaw_rad=-e.yaw_rad, y_m=-e.y_m) if isinstance(e, Odometry) else e for e in LOG]
    result = run(IspaceMclConfig(start=START), log=mirrored)
    assert "its yaw and y have the wrong sign" in result.notes[0]
    assert result.measures["motion"]["odometry_check"]["yaw_sign"] == -1
    assert errors(result)[0].max() < 0.25
