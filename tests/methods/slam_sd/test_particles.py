"""The Rao-Blackwellised filter: weights, resampling, and what enters the maps when."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.config import FilterConfig, SlamSdConfig
from gridslam.methods.slam_sd.particles import ParticleMaps, residual_ancestors

WINDOW = 3
CONFIG = SlamSdConfig(particles=6, filter=FilterConfig(window_key_scans=WINDOW))
STEP = np.array([0.3, 0.0, 0.0])
DEVIATIONS = np.array([0.01, 0.01, 0.001])


def wall_scan(offset_m: float = 0.0) -> PreparedScan:
    """Points of a wall two metres to the left."""
    points = np.column_stack([np.linspace(-3, 3, 40), np.full(40, 2.0 + offset_m)])
    normals = np.tile([0.0, -1.0], (40, 1))
    return PreparedScan(0, np.zeros(2), points, points, normals, points, normals)


def filled(scans: int) -> ParticleMaps:
    particles = ParticleMaps(CONFIG, np.random.default_rng(0))
    for k in range(scans):
        particles.add(wall_scan(), STEP if k else np.zeros(3), DEVIATIONS)
    return particles


@pytest.mark.parametrize("seed", range(5))
def test_residual_resampling_keeps_what_is_sure_and_the_place_of_survivors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(12, 0.4))
    ancestors = residual_ancestors(weights, rng)
    counts = np.bincount(ancestors, minlength=12)
    assert counts.sum() == 12
    assert (counts >= np.floor(12 * weights)).all()
    survivors = np.flatnonzero(counts)
    np.testing.assert_array_equal(ancestors[survivors], survivors)


def test_a_key_scan_enters_the_maps_when_its_window_is_full() -> None:
    assert filled(WINDOW - 1).next_inserted is None
    particles = filled(WINDOW)
    assert particles.next_inserted == 0
    assert particles.grids.surfaces.memory_mb == filled(WINDOW - 1).grids.surfaces.memory_mb
    particles.add(wall_scan(), STEP, DEVIATIONS)
    assert particles.next_inserted == 1


def test_a_key_scan_can_be_replaced_until_it_enters() -> None:
    one, other = filled(WINDOW), filled(WINDOW)
    other.replace_scan(0, wall_scan(offset_m=1.0))
    for particles in (one, other):
        particles.add(wall_scan(), STEP, DEVIATIONS)
    assert not np.array_equal(one.grids.surfaces.pool, other.grids.surfaces.pool, equal_nan=True)


def test_paths_weigh_relative_to_the_best_and_one_weighing_takes_a_bounded_amount() -> None:
    particles = filled(2)
    before = particles.log_weights.copy()
    particles.weigh_paths(np.array([0.0, -0.2, -50.0, -0.1, -0.3, -0.4]))
    change = particles.log_weights - before
    np.testing.assert_allclose(change - change[0], [0.0, -0.2, -1.0, -0.1, -0.3, -0.4], atol=1e-12)
    assert particles.log_weights.max() == 0.0
    assert particles.trajectories.shape == (6, 2, 3)
