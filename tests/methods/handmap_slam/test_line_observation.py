"""Drawn lines that are observed or missing, and the resulting correction (paper section 6.1)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.maps.drawings.drawing import Drawing, DrawnMap, drawn_map
from gridslam.matching.lines import LineSegments
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.line_front_end import heading_difference
from gridslam.methods.handmap_slam.line_observation import (
    SIGMA_M,
    LineObserver,
    correction_of,
    families_observed,
)

LENGTH_M, WIDTH_M = 25.0, 4.0


def corridor() -> DrawnMap:
    """A corridor of 25 x 4 m at 0.1 m per pixel, with a border of 1 m."""
    levels = np.full((61, 271), 255, np.uint8)
    levels[[10, 50], 10:261] = 0
    levels[10:51, [10, 260]] = 0
    return drawn_map(Drawing(levels, "corridor"))


def scan_of(length_m: float, x_m: float, y_m: float = 2.0) -> tuple[LineSegments, np.ndarray]:
    """Lines and points of a corridor of this length, seen from (x, y) in it with heading 0."""
    corners = np.array([(0, 0), (length_m, 0), (length_m, WIDTH_M), (0, WIDTH_M)]) - (x_m, y_m)
    lines = LineSegments(corners, np.roll(corners, -1, axis=0))
    fraction = np.linspace(0.0, 1.0, 80)[:, None]
    points = np.concatenate([a + fraction * (b - a) for a, b in zip(lines.starts, lines.ends, strict=True)])
    return lines, points


def pose_at(x_m: float, y_m: float = 2.0, yaw: float = 0.0) -> DrawingPose:
    """The pose at (x, y) of the drawn corridor."""
    return DrawingPose(0, x_m + 1.05, y_m + 1.05, yaw, 1.0, 1.0, 0.1, 1.0)


@pytest.fixture(scope="module")
def observer() -> LineObserver:
    return LineObserver(corridor())


def test_all_lines_are_observed_where_drawing_and_place_agree(observer):
    lines, points = scan_of(LENGTH_M, 8.0)
    observed = observer.observe(lines, points, pose_at(8.0))
    assert families_observed(observed) == {"x": True, "y": True}
    assert min(line.probability for line in observed) > 0.9
    assert not correction_of(observed, 0.1).any()


def test_the_probability_is_that_of_equation_1(observer):
    lines, points = scan_of(LENGTH_M, 8.0, 2.0)
    observed = observer.observe(lines, points, pose_at(8.3))
    for line in observed:
        expected = math.exp(-((line.observed_m - line.drawn_m) ** 2) / (2.0 * SIGMA_M**2))
        assert line.probability == pytest.approx(expected)
        if line.family == "x":
            assert abs(line.observed_m - line.drawn_m) == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize(("length", "towards"), [(20.0, 1), (35.0, -1)])
def test_the_position_moves_forwards_if_the_drawing_is_too_long_and_backwards_if_too_short(
    observer, length, towards
):
    # The end wall is 1.5 m from where it is drawn; the other end is out of range.
    x = length - 5.0
    lines, points = scan_of(length, x)
    ahead = lines.ends[:, 0] > 0.0
    lines = LineSegments(lines.starts[ahead], lines.ends[ahead])
    points = points[points[:, 0] > -3.0]
    offset = 25.0 - length
    observed = observer.observe(lines, points, pose_at(x + offset - 1.5 * towards))
    step = correction_of([line for line in observed if line.side > 0 or line.family == "y"], 0.1)
    assert step[1] == 0.0
    assert np.sign(step[0]) == towards
    assert abs(step[0]) == pytest.approx(0.1)


def test_without_beams_no_line_is_judged(observer):
    observed = observer.observe(LineSegments.none(), np.zeros((0, 2)), pose_at(8.0))
    assert not observed
    assert not correction_of(observed, 0.1).any()


def beams(max_range_m: float) -> np.ndarray:
    """Endpoints of beams around a robot in the middle of an endless corridor 4 m wide."""
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    ranges = np.minimum(2.0 / np.maximum(np.abs(np.sin(bearings)), 1e-9), max_range_m)
    return np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]


def test_beams_beyond_a_drawn_end_contradict_it_and_short_beams_do_not(observer):
    sides, _ = scan_of(100.0, 50.0)
    sides = LineSegments(sides.starts[[0, 2]], sides.ends[[0, 2]])
    # The drawn end is 5 m ahead: a lidar of 8 m sees that it is not there, one of 4 m cannot.
    far, near = (observer.observe(sides, beams(max_range), pose_at(20.0)) for max_range in (8.0, 4.0))
    assert families_observed(far) == {"x": False, "y": True}
    step = correction_of(far, 0.1)
    assert step[0] == pytest.approx(-0.1)  # back: the drawing is too short
    assert families_observed(near) == {"y": True}
    assert not correction_of(near, 0.1).any()


def test_only_lines_near_the_robot_are_judged(observer):
    # An end wall 12 m ahead is drawn where it is, the near one behind is not: the family x is not observed.
    lines, points = scan_of(15.5, 3.5)
    observed = observer.observe(lines, points, pose_at(13.0))
    assert {line.side for line in observed if line.family == "x"} == {-1}
    assert not families_observed(observed)["x"]


def test_lines_correct_the_heading(observer):
    lines, _ = scan_of(LENGTH_M, 8.0)
    # The estimated heading is wrong by 0.06 rad.
    correction = heading_difference(lines, pose_at(8.0, yaw=0.06), observer)
    assert correction == pytest.approx(-0.06, abs=0.015)


def test_without_lines_there_is_no_heading_correction(observer):
    assert heading_difference(LineSegments.none(), pose_at(8.0), observer) is None


def test_points_transform_into_the_drawing_and_back():
    pose = DrawingPose(0, 3.0, 4.0, 0.7, 1.4, 0.6, 0.1, 1.0)
    points = np.random.default_rng(0).normal(size=(20, 2))
    np.testing.assert_allclose(pose.from_drawing(pose.to_drawing(points)), points, atol=1e-12)


def test_a_motion_in_metres_is_scaled_into_the_drawing():
    pose = DrawingPose(0, 3.0, 4.0, math.pi / 2, 1.4, 0.5, 0.1, 1.0)
    after = pose.after(np.array([2.0, 0.0, 0.1]))
    assert (after.x, after.y) == pytest.approx((3.0, 5.0))
    assert after.yaw_rad == pytest.approx(math.pi / 2 + 0.1)
