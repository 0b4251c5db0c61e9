"""Surface maps against their slow reference, and registration in a room."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.scan_matching import surfel_likelihood, surfel_registration, surfels
from gridslam.kernels.scan_matching.surfel_likelihood import EndpointModel
from gridslam.kernels.scan_matching.surfel_registration import PosePrior, Registration, YawSearch
from gridslam.kernels.scan_matching.surfels import OrientedPoints
from gridslam.maps.tiled import TileStore
from tests.reference import surfels as reference

Floats = NDArray[np.float64]
CELL_M = 0.2


def store_of(points: Floats, normals: Floats) -> TileStore:
    store = TileStore(1, surfels.CHANNELS, CELL_M)
    store.own_endpoints(np.array([0]), np.zeros((1, 3)), points)
    surfels.insert_surfels(store.map(0), np.zeros(3), OrientedPoints(points, normals))
    return store


def random_surfaces(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    points = rng.uniform(-2.0, 2.0, (n, 2))
    angle = rng.uniform(-np.pi, np.pi, n)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normals[rng.random(n) < 0.2] = 0.0
    return points, normals


@given(seed=st.integers(0, 10_000), n=st.integers(1, 400))
@settings(max_examples=40, deadline=None)
def test_cells_hold_the_running_means_of_the_reference_implementation(seed: int, n: int) -> None:
    points, normals = random_surfaces(np.random.default_rng(seed), n)
    store = store_of(points, normals)
    expected: reference.Surfaces = {}
    reference.insert(expected, points, normals, CELL_M)
    values, (row, col) = store.dense(0)
    found = {(int(r) + row, int(c) + col): values[r, c] for r, c in np.argwhere(values[..., 0] > 0)}
    assert found.keys() == expected.keys()
    for cell, (count, mean, direction) in expected.items():
        np.testing.assert_allclose(found[cell], [count, *mean, *direction], atol=2e-5)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_likelihood_is_that_of_the_reference_implementation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    store, expected = store_of(*(surface := random_surfaces(rng, 60))), {}
    reference.insert(expected, *surface, CELL_M)
    points, normals = random_surfaces(rng, 25)
    free = TileStore(1, 1, CELL_M)
    scan, model = OrientedPoints(points, normals), EndpointModel(0.06, 0.3, 0.1)
    found = surfel_likelihood.log_likelihood(store.map(0), free.map(0), np.zeros(2), scan, np.zeros(3), model)
    assert found == pytest.approx(
        reference.log_likelihood(expected, points, normals, 0.06, 0.3, 0.1), abs=2e-3
    )


def room(n: int) -> tuple[Floats, Floats]:
    """Points on a rectangle of 6 x 4 m and on a round column, with normals towards the free space."""
    t = np.linspace(0.0, 1.0, n, endpoint=False)
    sides = [
        (np.stack([6 * t - 3, np.full(n, -2.0)], 1), [0.0, 1.0]),
        (np.stack([6 * t - 3, np.full(n, 2.0)], 1), [0.0, -1.0]),
        (np.stack([np.full(n, -3.0), 4 * t - 2], 1), [1.0, 0.0]),
        (np.stack([np.full(n, 3.0), 4 * t - 2], 1), [-1.0, 0.0]),
    ]
    circle = np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)], 1)
    points = np.concatenate([p for p, _ in sides] + [[1.5, 0.5] + 0.4 * circle])
    normals = np.concatenate([np.tile(n_, (n, 1)) for _, n_ in sides] + [circle])
    return points, normals


@given(
    x=st.floats(-0.15, 0.15), y=st.floats(-0.15, 0.15), yaw=st.floats(-0.08, 0.08), seed=st.integers(0, 1000)
)
@settings(max_examples=40, deadline=None)
def test_registration_finds_a_displacement_to_millimetres(x: float, y: float, yaw: float, seed: int) -> None:
    store = store_of(*room(150))
    truth = np.array([x, y, yaw])
    points, normals = room(41)
    noisy = points + np.random.default_rng(seed).normal(0.0, 0.005, points.shape)
    seen = se2.transform_points(se2.inverse(truth), noisy)
    rotated = se2.transform_points(np.array([0.0, 0.0, -yaw]), normals)
    weak = np.diag([1e-3, 1e-3, 1e-3])
    pose, information, used = surfel_registration.register(
        store.map(0),
        OrientedPoints(seen, rotated),
        np.zeros(3),
        PosePrior(np.zeros(3), weak),
        Registration(0.05, 0.4, 0.1, 20, 0.0),
    )
    assert (np.abs(pose - truth) < [0.006, 0.006, 0.003]).all()
    assert used > 0.8 * len(points)
    assert np.linalg.eigvalsh(information).min() > 0.0


@pytest.mark.parametrize("seed", range(4))
def test_registration_takes_the_steps_of_the_reference_implementation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface, (points, normals) = room(150), room(23)
    store, start = store_of(*surface), rng.uniform(-0.05, 0.05, 3)
    surfaces: reference.Surfaces = {}
    reference.insert(surfaces, *surface, CELL_M)
    weak = np.diag([20.0, 20.0, 50.0])
    pose, _, used = surfel_registration.register(
        store.map(0),
        OrientedPoints(points, normals),
        start,
        PosePrior(start, weak),
        Registration(0.05, 0.4, 0.1, 6, 0.0),
    )
    expected, count = reference.register(surfaces, points, normals, start, weak, 0.05, 0.4, 0.1, 6)
    np.testing.assert_allclose(pose, expected, atol=1e-4)
    assert abs(used - count) <= 1


@pytest.mark.parametrize("seed", range(4))
def test_the_yaw_found_is_the_one_at_which_most_points_lie_on_surfaces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    surface, (points, normals) = room(150), room(23)
    store, pose = store_of(*surface), np.array([0.02, -0.03, rng.uniform(-0.25, 0.25)])
    surfaces: reference.Surfaces = {}
    reference.insert(surfaces, *surface, CELL_M)
    found = surfel_registration.search_yaw(
        store.map(0), OrientedPoints(points, normals), pose, YawSearch(0.05, 6, 1000, 0.1, 0.3)
    )
    offsets = 0.05 * np.arange(-6, 7)
    scores = reference.yaw_scores(surfaces, points, normals, pose, offsets, 0.1, 0.3)
    assert found[2] == pytest.approx(pose[2] + offsets[int(np.argmax(scores))])


def test_without_surfaces_the_prior_is_returned() -> None:
    store = TileStore(1, surfels.CHANNELS, CELL_M)
    prior = np.array([0.3, -0.2, 0.5])
    points, normals = room(10)
    pose, information, used = surfel_registration.register(
        store.map(0),
        OrientedPoints(points, normals),
        prior,
        PosePrior(prior, np.eye(3)),
        Registration(0.05, 0.4, 0.1, 10, 0.0),
    )
    np.testing.assert_allclose(pose, prior)
    assert used == 0
    assert not information.any()


@given(seed=st.integers(0, 10_000), max_distance_m=st.sampled_from([0.05, 0.1, 0.3, 0.55]))
@settings(max_examples=40, deadline=None)
def test_the_nearest_surface_is_found_in_whichever_cell_it_lies(seed: int, max_distance_m: float) -> None:
    rng = np.random.default_rng(seed)
    store, expected = store_of(*(surface := random_surfaces(rng, 150))), {}
    reference.insert(expected, *surface, CELL_M)
    for point, normal in zip(*random_surfaces(rng, 25), strict=True):
        tile, row, col = surfels.nearest_surfel(store.map(0), *point, *normal, max_distance_m)
        nearest = reference.nearest(expected, point, normal, max_distance_m)
        assert (tile >= 0) == (nearest is not None)
        if nearest is not None:
            cell = store.pool[tile, row, col]
            np.testing.assert_allclose(cell[[surfels.X, surfels.Y]], nearest[0], atol=2e-5)
