from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.errors import MapError
from gridslam.filters.free_space import draw_free_poses, free_cells
from gridslam.filters.kld import particles_needed
from gridslam.filters.particles import Particles, main_cluster, moments
from gridslam.filters.resampling import AdaptiveSize, Strata, resample, resample_strata
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid


def test_kld_sampling_needs_as_many_particles_as_the_chi_square_quantile_gives():
    # chi-square quantile 0.99 with 99 degrees of freedom is 134.642; n = quantile / (2 error) (Fox 2003, eq. 4).
    assert particles_needed(100, 0.05, 2.3263) == pytest.approx(134.642 / 0.1, rel=0.001)
    assert particles_needed(1, 0.05, 2.33) == 1


def test_the_effective_size_is_one_for_one_particle_and_all_for_even_weights():
    poses = np.zeros((8, 3))
    assert Particles.even(poses).effective_size == pytest.approx(8.0)
    assert Particles(poses, np.eye(8)[2]).effective_size == pytest.approx(1.0)


def test_weights_survive_likelihoods_below_the_smallest_float():
    particles = Particles(np.zeros((3, 3)), np.array([0.0, 0.5, 0.5]))
    reweighted = particles.reweighted(np.array([0.0, -5000.0, -5000.0 + math.log(3.0)]))
    np.testing.assert_allclose(reweighted.weights, [0.0, 0.25, 0.75])


def test_the_mean_heading_is_circular():
    belief = moments(Particles.even(np.array([[0.0, 0.0, math.pi - 0.1], [1.0, 0.0, -math.pi + 0.1]])))
    assert abs(belief.mean[2]) == pytest.approx(math.pi)
    np.testing.assert_allclose(np.diag(belief.covariance), [0.25, 0.0, 0.01], atol=1e-12)


def test_the_main_cluster_is_the_heavier_one_and_not_the_mean_of_both():
    rng = np.random.default_rng(0)
    few = rng.normal((0.0, 0.0, 0.0), 0.05, (300, 3))
    many = rng.normal((10.0, 4.0, 3.1), 0.05, (700, 3))
    belief = main_cluster(Particles.even(np.concatenate([few, many])), 1.0, 0.5)
    np.testing.assert_allclose(belief.mean, [10.0, 4.0, 3.1], atol=0.02)
    assert belief.mass == pytest.approx(0.7)
    assert belief.std_m == pytest.approx(0.05 * math.sqrt(2.0), rel=0.1)


def test_a_cluster_across_a_bin_edge_is_not_split():
    rng = np.random.default_rng(1)
    poses = rng.normal((0.0, 0.0, 0.0), 0.1, (1000, 3))
    assert main_cluster(Particles.even(poses), 1.0, 0.5).mass > 0.999


def test_clusters_at_large_distances_do_not_need_a_table_of_all_bins():
    poses = np.array([[0.0, 0.0, 0.0], [1e6, 1e6, 0.0], [1e6, 1e6, 0.0]])
    assert main_cluster(Particles.even(poses), 1.0, 0.5).mean[0] == pytest.approx(1e6)


def test_few_bins_need_few_particles_and_many_bins_many():
    rng = np.random.default_rng(2)
    size = AdaptiveSize(min=500, max=5000, error=0.02, quantile=2.33, bin_m=0.25, bin_rad=0.2)
    narrow = Particles.even(rng.normal(0.0, 0.02, (5000, 3)))
    wide = Particles.even(rng.uniform(-20, 20, (5000, 3)))
    assert len(resample(narrow, size, rng)) == 500
    assert len(resample(wide, size, rng)) == 5000


def test_resampling_keeps_the_mean():
    rng = np.random.default_rng(3)
    poses = rng.normal(0.0, 1.0, (4000, 3))
    particles = Particles.even(poses).reweighted(-0.5 * (poses[:, 0] - 1.0) ** 2)
    size = AdaptiveSize(min=4000, max=4000, error=0.02, quantile=2.33, bin_m=0.25, bin_rad=0.2)
    drawn = resample(particles, size, rng)
    assert moments(drawn).mean[0] == pytest.approx(moments(particles).mean[0], abs=0.01)
    np.testing.assert_allclose(drawn.weights, 1.0 / 4000)


def test_strata_keep_their_weights_however_often_they_are_resampled():
    rng = np.random.default_rng(5)
    places = np.repeat(np.arange(10), 400)
    poses = np.column_stack([10.0 * places + 0.5, np.full(4000, 0.5), np.full(4000, 0.25)])
    poses += rng.normal(0.0, 0.01, poses.shape)
    weights = np.where(places == 3, 0.9, 0.1 / 9)
    particles = Particles(poses, weights / weights.sum())
    size = AdaptiveSize(min=1000, max=1000, error=0.02, quantile=2.33, bin_m=0.25, bin_rad=0.2)
    for _ in range(50):
        particles = resample_strata(particles, Strata.of(particles, 1.0, 0.5), size, rng)
    kept = np.bincount((particles.poses[:, 0] // 10).astype(int), particles.weights, 10)
    np.testing.assert_allclose(kept, np.where(np.arange(10) == 3, 0.9, 0.1 / 9), rtol=1e-9)


def test_an_unlikely_stratum_has_the_root_of_its_weight_in_particles():
    rng = np.random.default_rng(6)
    poses = np.repeat([[0.5, 0.5, 0.25], [9.5, 0.5, 0.25]], 500, axis=0)
    particles = Particles(poses, np.repeat([0.9999, 0.0001], 500) / 500)
    size = AdaptiveSize(min=1000, max=1000, error=0.02, quantile=2.33, bin_m=0.25, bin_rad=0.2)
    drawn = resample_strata(particles, Strata.of(particles, 1.0, 0.5), size, rng)
    assert (drawn.poses[:, 0] > 5.0).sum() == pytest.approx(1000 * 0.01 / 1.01, abs=1)
    assert drawn.weights[drawn.poses[:, 0] > 5.0].sum() == pytest.approx(0.0001)


def test_free_poses_lie_in_free_cells_of_a_rotated_map():
    rng = np.random.default_rng(4)
    probability = np.where(rng.random((30, 20)) < 0.5, 0.05, np.nan).astype(np.float32)
    grid = OccupancyGrid(probability, GridGeometry(0.2, (3.0, -1.0), 0.7))
    free = free_cells(grid, 0.3)
    cells = grid.geometry.cells(draw_free_poses(free, grid, 500, rng)[:, :2])
    assert free[cells[:, 0], cells[:, 1]].all()


def test_a_map_without_free_space_is_an_error():
    grid = OccupancyGrid(np.full((3, 3), 0.9, np.float32), GridGeometry(0.1, (0.0, 0.0)))
    with pytest.raises(MapError, match="no free cell"):
        free_cells(grid, 0.3)
