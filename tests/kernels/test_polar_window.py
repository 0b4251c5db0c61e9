"""Grids to rays and rays to cells, against slow and obvious versions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.kernels.polar_window import averaged_over_turns, priors_of_rays, window_of_rays
from tests.reference import polar_window as reference


def test_priors_are_those_of_the_cells_that_a_ray_meets() -> None:
    rng = np.random.default_rng(0)
    log_odds, eye, angles = rng.normal(size=(30, 40)), np.array([20.3, 14.6]), np.array([-2.0, 0.3, 1.1])
    priors, correlations = priors_of_rays(log_odds, eye, angles, 1.5, 8, -0.5, 0.8)
    for i, angle in enumerate(angles):
        expected, correlation = reference.priors_of_ray(log_odds, eye, angle, 1.5, 8, -0.5, 0.8)
        assert priors[i] == pytest.approx(expected, abs=1e-12)
        assert correlations[i, 1:] == pytest.approx(correlation, abs=1e-12)


def test_every_cell_has_the_value_of_the_nearest_ray_at_its_range() -> None:
    rng = np.random.default_rng(1)
    polar, rest = rng.normal(size=(2, 7, 12)), np.array([1.0, -3.0])
    bearings, reach = np.sort(rng.uniform(-0.6, 0.9, 7)), 0.12
    corner, first = np.array([-5.3, -8.2]), 2.0
    window = window_of_rays(polar, rest, bearings, reach, first, corner, 17, 20)
    expected = reference.window_of_rays(polar, rest, bearings, reach, first, corner, 17, 20)
    assert window == pytest.approx(expected)
    assert (expected != rest[:, None, None]).any(axis=0).sum() > 20


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
    expected = reference.averaged_over_turns(polar, rest, bearings, 0.06, turns, weights, angles)
    assert mean == pytest.approx(expected, abs=1e-12)
