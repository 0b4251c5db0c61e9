"""The whole method on the scripted hall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.errors import ConfigError, MethodError
from gridslam.core.messages import LaserScan, Odometry, readonly
from gridslam.maps.drawings.drawing import Drawing
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.method import HandmapSlam
from gridslam.runs.inputs import refuse_missing_inputs
from tests.methods.handmap_slam.places import (
    START,
    drawn_truth,
    events,
    hall_drawing,
    position_errors,
    run,
    start_in,
)

SHORT = 400  # events: a straight drive of 12 m


@pytest.fixture(scope="module")
def lap():
    """One lap with an accurate drawing."""
    return run(HandmapSlamConfig(start=START), hall_drawing())


def test_map_and_trajectory_are_metric(lap):
    result, _, _ = lap
    assert position_errors(result).max() < 0.05
    assert result.occupancy is not None
    occupied = np.argwhere(np.nan_to_num(result.occupancy.probability) > 0.65)
    corners = result.occupancy.geometry.centres(occupied)
    # The hall is 14 x 9 m, the start at (2, 1.5): the map spans exactly that.
    assert corners.min(axis=0) == pytest.approx([-2.0, -1.5], abs=0.15)
    assert corners.max(axis=0) == pytest.approx([12.0, 7.5], abs=0.15)


def test_the_map_is_checked_against_its_scans(lap):
    result, _, _ = lap
    consistency = result.measures["map_consistency"]
    assert consistency["compared_wall_m"] > 5.0
    assert consistency["doubt"] < 0.2
    assert result.doubt is None


def test_the_robot_is_localized_in_the_drawing_throughout(lap):
    _, pairs, _ = lap
    errors = [np.hypot(*(np.array([p.x, p.y]) - drawn_truth(t))) for p, t in pairs]
    assert max(errors) < 0.4
    assert np.mean(errors) < 0.25  # strokes are three pixels thick


def test_the_result_reports_on_the_drawing(lap):
    result, _, _ = lap
    facts = result.measures["drawing"]
    assert facts["matches_place"] and facts["coverage"] > 0.9
    assert facts["scale"] == pytest.approx(1.0, abs=0.05)
    lines = result.tables["lines"]
    assert list(lines.columns)[:3] == ["stamp", "line", "family"]
    assert {row[2] for row in lines.rows} == {"x", "y"}
    assert all(0.0 <= row[-1] <= 1.0 for row in lines.rows)
    for name in ("scale_x", "scale_y", "drawing_inlier_ratio", "lines_x", "lines_y"):
        assert len(result.series[name].values) == result.counters["drawing.updates"]
    assert {"drawing_free", "drawing_walls", "drawing_seen"} <= set(result.layers)
    assert result.pictures["drawing"].rgb.shape[2] == 3


def test_the_same_seed_gives_the_same_result_and_another_seed_other_particles():
    config = HandmapSlamConfig(start=START)
    (a, pairs_a, _), (b, pairs_b, _) = (run(config, hall_drawing(), max_events=SHORT) for _ in range(2))
    np.testing.assert_array_equal(a.trajectory.poses, b.trajectory.poses)
    assert a.tables["lines"].rows == b.tables["lines"].rows
    assert pairs_a[-1][0] == pairs_b[-1][0]
    _, pairs_c, _ = run(config, hall_drawing(), seed=1, max_events=SHORT)
    assert pairs_c[-1][0] != pairs_a[-1][0]


def test_without_a_start_the_whole_drawing_is_searched():
    _, pairs, _ = run(HandmapSlamConfig(), hall_drawing(0.7, 0.7))
    pose, truth = pairs[-1]
    assert [pose.x, pose.y] == pytest.approx(drawn_truth(truth, 0.7, 0.7), abs=0.4)


def test_the_paper_s_form_maps():
    config = HandmapSlamConfig(
        start=START,
        front_end="lines",
        localization={"separate_scales": False},
        pose_graph={"enabled": False},
    )
    result, pairs, _ = run(config, hall_drawing())
    assert position_errors(result).mean() < 0.15
    pose, truth = pairs[-1]
    assert [pose.x, pose.y] == pytest.approx(drawn_truth(truth), abs=0.4)


def test_a_drawing_of_another_place_is_reported_and_the_map_is_still_right():
    levels = np.full((200, 400), 255, np.uint8)
    rows, cols = np.mgrid[0:200, 0:400]
    outer_wall = np.abs(np.hypot((cols - 200) / 2.0, rows - 100) - 80) < 2
    star = np.abs((cols + rows) % 60 - 30) < 1
    levels[outer_wall | (star & (np.hypot((cols - 200) / 2.0, rows - 100) < 78) & (rows % 40 > 12))] = 0
    result, _, _ = run(
        HandmapSlamConfig(start=(20.0, 10.0, 0.0), localization={"scale": 1.0}), Drawing(levels, "other.png")
    )
    assert position_errors(result).max() < 0.05
    facts = result.measures["drawing"]
    assert facts["inlier_ratio"] < 0.8


def test_scans_without_returns_are_counted_and_tracking_continues():
    config = HandmapSlamConfig(start=START)
    method = HandmapSlam(config, 0, drawing=hall_drawing())
    for index, event in enumerate(events()[:SHORT]):
        if isinstance(event, LaserScan) and index > 50 and index % 3 == 0:
            event = replace(event, ranges_m=readonly(np.full(len(event.ranges_m), np.inf), np.float32))
        if isinstance(event, LaserScan) and index > 50 and index % 7 == 0:
            event = replace(event, ranges_m=readonly(np.zeros(0), np.float32))
        method.process(event)
    result = method.result()
    assert result.counters["scan.empty"] > 20
    assert position_errors(result).max() < 0.1


def test_a_log_of_empty_scans_is_refused_in_one_line():
    method = HandmapSlam(HandmapSlamConfig(start=START), 0, drawing=hall_drawing())
    for event in events()[:100]:
        if isinstance(event, LaserScan):
            event = replace(event, ranges_m=readonly(np.full(len(event.ranges_m), np.nan), np.float32))
        method.process(event)
    assert method.drawing_pose is None
    with pytest.raises(MethodError, match="none of the 48 scans has a reading") as refused:
        method.result()
    assert "\n" not in str(refused.value)


def test_no_events_give_an_empty_result():
    result = HandmapSlam(HandmapSlamConfig(), 0, drawing=hall_drawing()).result()
    assert len(result.trajectory) == 0


def test_odometry_that_is_not_finite_is_skipped_and_counted():
    method = HandmapSlam(HandmapSlamConfig(start=START), 0, drawing=hall_drawing())
    for event in events()[:60]:
        method.process(event)
        if isinstance(event, Odometry):
            method.process(replace(event, x_m=float("nan")))
    assert method.result().counters["skipped.odom.not_finite"] > 10


def test_a_start_outside_the_drawing_is_an_error():
    with pytest.raises(ConfigError, match=r"method\.start"):
        HandmapSlam(HandmapSlamConfig(start=(-1.0, 2.0, 0.0)), 0, drawing=hall_drawing())


def test_a_run_without_drawing_is_an_error():
    with pytest.raises(ConfigError, match="--drawing FILE: handmap-slam needs it"):
        refuse_missing_inputs("handmap-slam", {})


@pytest.mark.parametrize(("scale_x", "scale_y"), [(1.0, 1.0), (0.5, 0.5), (1.8, 1.8)])
def test_the_scale_of_an_undistorted_drawing_is_estimated_within_a_stroke(scale_x, scale_y):
    result, _, _ = run(
        HandmapSlamConfig(start=start_in(scale_x, scale_y)), hall_drawing(scale_x, scale_y), max_events=SHORT
    )
    # Strokes of 3 pixels: their surfaces are nearer together than what they stand for.
    assert result.measures["drawing"]["scale"] == pytest.approx(scale_x, rel=0.03 + 0.02 / scale_x)


@pytest.mark.parametrize(("scale_x", "scale_y"), [(1.3, 1.0), (0.8, 1.1)])
def test_the_two_scales_of_a_stretched_drawing_are_estimated_within_a_stroke(scale_x, scale_y):
    result, _, _ = run(HandmapSlamConfig(start=start_in(scale_x, scale_y)), hall_drawing(scale_x, scale_y))
    facts = result.measures["drawing"]
    assert facts["scale_x"] == pytest.approx(scale_x, rel=0.05)
    assert facts["scale_y"] == pytest.approx(scale_y, rel=0.05)


def test_odometry_with_a_mirrored_yaw_is_used_corrected():
    method = HandmapSlam(HandmapSlamConfig(start=START), 0, drawing=hall_drawing())
    for event in events():
        mirrored = (
            replace(event, yaw_rad=-event.yaw_rad, y_m=-event.y_m) if isinstance(event, Odometry) else event
        )
        method.process(mirrored)
    result = method.result()
    assert "its yaw and y have the wrong sign" in result.notes[0]
    assert result.measures["motion"]["odometry_check"]["yaw_sign"] == -1
    assert position_errors(result).max() < 0.1
