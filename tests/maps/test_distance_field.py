from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.maps.distance_field import distance_to_occupied
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

GEOMETRY = GridGeometry(0.05, (1.0, -2.0), 0.3)


def brute_force(probability: np.ndarray, occupied_from: float) -> np.ndarray:
    rows, cols = np.indices(probability.shape)
    walls = np.argwhere(probability > occupied_from)
    squared = (rows[..., None] - walls[:, 0]) ** 2 + (cols[..., None] - walls[:, 1]) ** 2
    return np.sqrt(squared.min(axis=-1, initial=np.iinfo(int).max))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 40), st.integers(1, 40), st.floats(0.2, 0.9))
def test_distances_equal_the_smallest_over_all_walls(
    seed: int, rows: int, cols: int, occupied_from: float
) -> None:
    rng = np.random.default_rng(seed)
    probability = (rng.random((rows, cols)) ** 3).astype(np.float32)
    probability[rng.random((rows, cols)) < 0.2] = np.nan
    probability[rng.integers(rows), rng.integers(cols)] = 1.0
    field = distance_to_occupied(OccupancyGrid(probability, GEOMETRY), occupied_from)
    expected = brute_force(probability, occupied_from) * GEOMETRY.resolution_m
    assert field.geometry == GEOMETRY
    assert field.values.dtype == np.float32
    assert np.allclose(field.values, expected, rtol=1e-5, atol=1e-7)


def test_a_long_map_has_exact_distances_too() -> None:
    probability = np.zeros((3, 3000), np.float32)
    probability[0, 0] = 1.0
    field = distance_to_occupied(OccupancyGrid(probability, GEOMETRY))
    assert field.values[2, 2999] == pytest.approx(0.05 * np.hypot(2, 2999), rel=1e-6)


def test_distances_are_bounded_and_infinite_without_walls() -> None:
    empty = OccupancyGrid(np.zeros((2, 3), np.float32), GEOMETRY)
    assert np.isinf(distance_to_occupied(empty).values).all()
    assert distance_to_occupied(empty, max_distance_m=0.5).values.tolist() == [[0.5] * 3] * 2
    assert distance_to_occupied(OccupancyGrid(np.zeros((0, 3), np.float32), GEOMETRY)).values.shape == (0, 3)
