"""Lines in scans and drawings against lines that were put there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gridslam.maps.occupancy import GridGeometry
from gridslam.matching.lines import LineSegments, difference_modulo_pi, hough_segments, ransac_lines


def noisy_line(start, end, n, sigma, rng):
    start, end = np.asarray(start, float), np.asarray(end, float)
    return start + rng.random((n, 1)) * (end - start) + rng.normal(0.0, sigma, (n, 2))


def test_ransac_finds_the_walls_of_a_room_among_clutter():
    rng = np.random.default_rng(0)
    corners = np.array([(-2.0, -1.5), (4.0, -1.5), (4.0, 1.5), (-2.0, 1.5), (-2.0, -1.5)])
    walls = [noisy_line(a, b, 60, 0.01, rng) for a, b in pairwise(corners)]
    clutter = rng.uniform(-1.4, 1.4, (30, 2))
    found = ransac_lines(np.concatenate([*walls, clutter]), 0.05, 15, 8, 100, rng)
    assert len(found) == 4
    assert sorted(np.abs(np.degrees(difference_modulo_pi(found.directions_rad, 0.0)))) == pytest.approx(
        [0.0, 0.0, 90.0, 90.0], abs=1.0
    )
    assert sorted(found.lengths_m) == pytest.approx([3.0, 3.0, 6.0, 6.0], abs=0.35)


def test_points_of_a_disc_hold_no_line():
    angle = np.linspace(-np.pi, np.pi, 120, endpoint=False)
    circle = 5.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    found = ransac_lines(circle, 0.02, 15, 8, 100, np.random.default_rng(0))
    assert len(found) == 0


@pytest.mark.parametrize("n", [0, 1, 5])
def test_too_few_points_hold_no_line(n):
    assert len(ransac_lines(np.zeros((n, 2)), 0.05, 6, 8, 50, np.random.default_rng(0))) == 0


def test_the_same_stream_finds_the_same_lines():
    points = np.random.default_rng(3).normal(size=(200, 2))
    a, b = (ransac_lines(points, 0.1, 10, 5, 50, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(a.starts, b.starts)


def test_hough_segments_lie_where_they_were_drawn():
    walls = np.zeros((80, 150), np.bool_)
    walls[20, 10:140] = True  # y = 2.05 m
    walls[20:70, 60] = True  # x = 6.05 m
    found = hough_segments(walls, GridGeometry(0.1, (0.0, 0.0)), 2.0, 0.3, 10)
    horizontal = np.abs(difference_modulo_pi(found.directions_rad, 0.0)) < 0.05
    assert horizontal.any() and (~horizontal).any()
    assert found.starts[horizontal][:, 1] == pytest.approx(2.05, abs=0.11)
    assert found.starts[~horizontal][:, 0] == pytest.approx(6.05, abs=0.11)
    assert found.lengths_m[horizontal].max() == pytest.approx(12.9, abs=0.5)


def test_an_empty_drawing_has_no_segments():
    assert len(hough_segments(np.zeros((50, 50), np.bool_), GridGeometry(0.1, (0.0, 0.0)), 1.0, 0.3, 10)) == 0


def test_directions_differ_modulo_pi():
    assert float(difference_modulo_pi(0.1, np.pi - 0.1)) == pytest.approx(0.2)
    assert float(difference_modulo_pi(np.pi, 0.0)) == pytest.approx(0.0)


def test_distances_are_those_to_segments_not_to_lines():
    line = LineSegments(np.array([[0.0, 0.0]]), np.array([[2.0, 0.0]]))
    distances = line.distances_to(np.array([[1.0, 1.0], [5.0, 4.0], [-3.0, 0.0]]))
    assert distances[:, 0] == pytest.approx([1.0, 5.0, 3.0])
