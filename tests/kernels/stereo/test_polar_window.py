"""Grids to rays and rays to cells, against slow and obvious versions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.kernels.stereo.polar_window import (
    GridRays,
    PolarWindow,
    averaged_over_yaw,
    priors_of_rays,
    window_of_rays,
)
from tests.reference import polar_window as reference


def test_priors_are_those_of_the_cells_along_a_ray() -> None:
    rng = np.random.default_rng(0)
    log_odds = rng.normal(size=(30, 40))
    rays = GridRays(np.array([20.3, 14.6]), np.array([-2.0, 0.3, 1.1]), first=1.5, cells=8)
    priors, correlations = priors_of_rays(log_odds, rays, -0.5, 0.8)
    for i in range(len(rays.angles)):
        expected, correlation = reference.priors_of_ray(log_odds, rays, i, -0.5, 0.8)
        assert priors[i] == pytest.approx(expected, abs=1e-12)
        assert correlations[i, 1:] == pytest.approx(correlation, abs=1e-12)


def test_every_cell_has_the_value_of_the_nearest_ray_at_its_range() -> None:
    rng = np.random.default_rng(1)
    polar, default = rng.normal(size=(2, 7, 12)), np.array([1.0, -3.0])
    rays = PolarWindow(polar, default, np.sort(rng.uniform(-0.6, 0.9, 7)), max_offset_rad=0.12)
    corner, first = np.array([-5.3, -8.2]), 2.0
    cells = window_of_rays(rays, first, corner, 17, 20)
    expected = reference.window_of_rays(rays, first, corner, 17, 20)
    assert cells == pytest.approx(expected)
    assert (expected != default[:, None, None]).any(axis=0).sum() > 20


def test_a_window_behind_the_robot_crosses_the_bearing_of_half_a_circle() -> None:
    bearings = np.linspace(math.pi - 0.3, math.pi + 0.3, 31)  # of a camera that looks backwards
    rays = PolarWindow(np.ones((1, 31, 10)), np.zeros(1), bearings, max_offset_rad=0.02)
    cells = window_of_rays(rays, 0.0, np.array([-9.0, -2.0]), 5, 9)
    assert (cells[0, 2, :9] == 1.0).all()


def test_the_mean_over_yaw_offsets_is_that_of_rotated_rays() -> None:
    rng = np.random.default_rng(2)
    polar, default = rng.normal(size=(2, 9, 4)), np.array([0.5, 2.0])
    rays = PolarWindow(polar, default, np.linspace(-0.4, 0.4, 9), max_offset_rad=0.06)
    yaw_offsets, weights = np.array([-0.1, 0.0, 0.1]), np.array([0.2, 0.5, 0.3])
    angles = np.linspace(-0.6, 0.6, 11)
    mean = averaged_over_yaw(rays, yaw_offsets, weights, angles)
    expected = reference.averaged_over_yaw(rays, yaw_offsets, weights, angles)
    assert mean == pytest.approx(expected, abs=1e-12)
