"""The Rao-Blackwellised filter: weights, resampling, and when key scans enter the maps."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.filters.residual_resampling import residual_ancestors
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.config import FilterConfig
from gridslam.methods.slam_sd.particle_filter import MAX_SCAN_EVIDENCE, ParticleFilter

WINDOW = 3
CONFIG = FilterConfig(window_key_scans=WINDOW)
STEP = np.array([0.3, 0.0, 0.0])
STEP_STD = np.array([0.01, 0.01, 0.001])


def wall_scan(offset_m: float = 0.0) -> PreparedScan:
    """Points of a wall two metres to the left."""
    points = np.column_stack([np.linspace(-3, 3, 40), np.full(40, 2.0 + offset_m)])
    normals = np.tile([0.0, -1.0], (40, 1))
    return PreparedScan(0, np.zeros(2), points, points, normals, points, normals)


def filled(scans: int) -> ParticleFilter:
    particles = ParticleFilter(6, CONFIG, 100.0, np.random.default_rng(0))
    for k in range(scans):
        particles.add_key_scan(wall_scan(), STEP if k else np.zeros(3), STEP_STD)
    return particles


@pytest.mark.parametrize("seed", range(5))
def test_residual_resampling_keeps_whole_copies_and_the_index_of_survivors(seed: int) -> None:
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
    particles.add_key_scan(wall_scan(), STEP, STEP_STD)
    assert particles.next_inserted == 1


def test_a_key_scan_can_be_replaced_until_it_enters() -> None:
    one, other = filled(WINDOW), filled(WINDOW)
    other.replace_scan(0, wall_scan(offset_m=1.0))
    for particles in (one, other):
        particles.add_key_scan(wall_scan(), STEP, STEP_STD)
    assert not np.array_equal(one.grids.surfaces.pool, other.grids.surfaces.pool, equal_nan=True)


def test_evidence_is_relative_to_the_best_path_and_bounded() -> None:
    particles = filled(2)
    before = particles.log_weights.copy()
    particles.add_evidence(np.array([0.0, -0.2, -50.0, -0.1, -0.3, -0.4]))
    change = particles.log_weights - before
    np.testing.assert_allclose(change - change[0], [0.0, -0.2, -1.0, -0.1, -0.3, -0.4], atol=1e-12)
    assert particles.log_weights.max() == 0.0
    assert particles.trajectories.shape == (6, 2, 3)


def test_new_ground_does_not_choose_among_the_particles() -> None:
    particles = filled(WINDOW + 2)
    particles.log_weights[:] = 0.0
    for k in range(12):
        particles.add_key_scan(wall_scan(offset_m=1.0 + k), STEP, STEP_STD)
        assert particles.matched_particles == 0
    assert not particles.log_weights.any()


def test_one_scan_lowers_a_weight_by_a_small_amount() -> None:
    particles = filled(WINDOW + 2)
    particles.log_weights[:] = 0.0
    particles._paths[3, len(particles._scans) - 1, 1] += 1.0
    particles.add_key_scan(wall_scan(), STEP, STEP_STD)
    assert 0 < particles.matched_particles < 6
    assert particles.log_weights.min() == pytest.approx(-MAX_SCAN_EVIDENCE)
