"""Scans that are compared with each other's points."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.kernels.grids import free_space
from tests.reference import free_space as reference

LIMITS = free_space.Tolerances(0.3, 0.01, 15.0)
SECTORS = 64


def test_testimony_is_that_of_the_reference_on_random_scans() -> None:
    rng = np.random.default_rng(4)
    n, m = 6, 80
    poses = np.column_stack([rng.uniform(-2, 2, (n, 2)), rng.uniform(-3, 3, n)])
    viewpoints = rng.uniform(-0.3, 0.3, (n, 2))
    angles = rng.uniform(-np.pi, np.pi, (n, m))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * rng.uniform(3.0, 9.0, (n, m, 1))
    returns = rays + viewpoints[:, None]
    first = np.arange(0, (n + 1) * m, m)
    flat = returns.reshape(-1, 2)
    profiles = free_space.Profiles(*free_space.scan_profiles(flat, first, viewpoints, SECTORS))
    pairs = [(i, j) for i in range(n) for j in range(n) if i != j]
    is_other = rng.random(len(pairs)) < 0.6
    partners = free_space.Partners(np.arange(0, n * n, n - 1), np.array([j for _, j in pairs]), is_other)
    found = free_space.testimony(flat, first, poses, viewpoints, profiles, partners, LIMITS)
    expected = np.zeros((3, n * m), np.int16)
    for (i, j), other in zip(pairs, is_other, strict=True):
        for k in range(m):
            point = se2.transform_points(poses[i], returns[i, k][None])[0]
            said = reference.verdict(point, poses[j], viewpoints[j], returns[j], SECTORS, LIMITS)
            row = {(True, 1): 0, (True, -1): 1, (False, 1): 2}.get((bool(other), said))
            if row is not None:
                expected[row, i * m + k] += 1
    assert np.array_equal(np.array(found), expected)
    assert expected.sum(axis=1).min() > 10


def test_a_sector_without_a_return_says_nothing() -> None:
    wall = np.array([[5.0, y] for y in np.linspace(-1.0, 1.0, 50)])
    viewpoints = np.zeros((2, 2))
    points = np.array([[2.0, 0.0], [-2.0, 0.0], [5.1, 0.0]])
    flat = np.concatenate([points, wall])
    first = np.array([0, 3, 53])
    profiles = free_space.Profiles(*free_space.scan_profiles(flat, first, viewpoints, 256))
    partners = free_space.Partners(np.array([0, 1, 1]), np.array([1]), np.array([True]))
    found = free_space.testimony(flat, first, np.zeros((2, 3)), viewpoints, profiles, partners, LIMITS)
    assert found.free_by_others[:3].tolist() == [1, 0, 0]
    assert found.occupied_by_others[:3].tolist() == [0, 0, 1]


def test_shifted_points_are_judged_as_the_reference_judges_them() -> None:
    rng = np.random.default_rng(5)
    n, m = 3, 60
    poses = np.column_stack([rng.uniform(-2, 2, (n, 2)), rng.uniform(-3, 3, n)])
    viewpoints = rng.uniform(-0.3, 0.3, (n, 2))
    angles = rng.uniform(-np.pi, np.pi, (n, m))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * rng.uniform(3.0, 9.0, (n, m, 1))
    returns = rays + viewpoints[:, None]
    first = np.arange(0, (n + 1) * m, m)
    flat = returns.reshape(-1, 2)
    profiles = free_space.Profiles(*free_space.scan_profiles(flat, first, viewpoints, SECTORS))
    points, shifts = rng.uniform(-6, 6, (50, 2)), rng.uniform(-2, 2, (7, 2))
    found = free_space.testimony_of_shifts(points, shifts, poses, viewpoints, profiles, LIMITS)
    for k, shift in enumerate(shifts):
        said = [
            reference.verdict(point + shift, poses[j], viewpoints[j], returns[j], SECTORS, LIMITS)
            for j in range(n)
            for point in points
        ]
        assert found[0][k] == said.count(1)
        assert found[1][k] == said.count(-1)
