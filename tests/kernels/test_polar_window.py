"""Grids to rays and rays to cells, against slow and obvious versions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.kernels.polar_window import averaged_over_turns, priors_of_rays, window_of_rays


def test_priors_are_those_of_the_cells_that_a_ray_meets() -> None:
    rng = np.random.default_rng(0)
    log_odds, eye, angles = rng.normal(size=(30, 40)), np.array([20.3, 14.6]), np.array([-2.0, 0.3, 1.1])
    priors, correlations = priors_of_rays(log_odds, eye, angles, 1.5, 8, -0.5, 0.8)
    for i, angle in enumerate(angles):
        cells = [
            (
                math.floor(eye[1] + (1.5 + k) * math.sin(angle)),
                math.floor(eye[0] + (1.5 + k) * math.cos(angle)),
            )
            for k in range(8)
        ]
        expected = [1.0 / (1.0 + math.exp(-(log_odds[c] - 0.5))) for c in cells]
        assert priors[i] == pytest.approx(expected, abs=1e-12)
        for k in range(1, 8):
            distance = math.hypot(cells[k][0] - cells[k - 1][0], cells[k][1] - cells[k - 1][1])
            assert correlations[i, k] == pytest.approx(0.8**distance, abs=1e-12)


def test_every_cell_has_the_value_of_the_nearest_ray_at_its_range() -> None:
    rng = np.random.default_rng(1)
    polar, rest = rng.normal(size=(2, 7, 12)), np.array([1.0, -3.0])
    bearings, reach = np.sort(rng.uniform(-0.6, 0.9, 7)), 0.12
    corner, first = np.array([-5.3, -8.2]), 2.0
    window = window_of_rays(polar, rest, bearings, reach, first, corner, 17, 20)
    touched = 0
    for row in range(17):
        for col in range(20):
            x, y = corner[0] + col, corner[1] + row
            k = math.floor(math.hypot(x, y) - first)
            off = np.abs(bearings - math.atan2(y, x))
            expected = polar[:, off.argmin(), k] if 0 <= k < 12 and off.min() <= reach else rest
            touched += expected is not rest
            assert window[:, row, col] == pytest.approx(expected)
    assert touched > 20


def test_a_window_behind_the_robot_goes_across_half_a_turn() -> None:
    bearings = np.linspace(math.pi - 0.3, math.pi + 0.3, 31)  # as a robot's that looks backwards
    window = window_of_rays(
        np.ones((1, 31, 10)), np.zeros(1), bearings, 0.02, 0.0, np.array([-9.0, -2.0]), 5, 9
    )
    assert (window[0, 2, :9] == 1.0).all()


def test_the_mean_over_turns_is_that_of_turned_rays() -> None:
    rng = np.random.default_rng(2)
    polar, rest = rng.normal(size=(2, 9, 4)), np.array([0.5, 2.0])
    bearings, turns, weights = (
        np.linspace(-0.4, 0.4, 9),
        np.array([-0.1, 0.0, 0.1]),
        np.array([0.2, 0.5, 0.3]),
    )
    angles = np.linspace(-0.6, 0.6, 11)
    mean = averaged_over_turns(polar, rest, bearings, 0.06, turns, weights, angles)
    for a, angle in enumerate(angles):
        expected = np.zeros((2, 4))
        for turn, weight in zip(turns, weights, strict=True):
            off = np.abs(bearings + turn - angle)
            expected += weight * (polar[:, off.argmin()] if off.min() <= 0.06 else rest[:, None])
        assert mean[:, a] == pytest.approx(expected, abs=1e-12)
