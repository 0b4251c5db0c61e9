from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.infrared import infrared_beams as kernel
from tests.reference import infrared as reference


@pytest.mark.parametrize("seed", range(5))
def test_drawing_a_reading_agrees_with_the_reference(seed: int) -> None:
    """Lines that pass exactly between two cells are left out, because either cell is right there."""
    rng = np.random.default_rng(seed)
    for _ in range(40):
        start = rng.integers(0, 40, 2)
        end = start + rng.choice([-1, 1], 2) * np.array([rng.integers(0, 20), rng.integers(0, 20)])
        rows, cols = np.abs(end - start)
        longer, shorter = max(rows, cols), min(rows, cols)
        if longer and (2 * shorter * np.arange(longer + 1) % (2 * longer) == longer).any():
            continue
        low = np.minimum(start, end)
        pos, expected = np.zeros((60, 60)), np.zeros((60, 60))
        a, b = start - low, end - low
        kernel.add_readings(pos, a[None], b[None], np.array([0.5]))
        reference.add_reading(expected, tuple(a.tolist()), tuple(b.tolist()), 0.5)
        assert np.allclose(pos, expected, atol=1e-12)


def test_the_sensor_model_along_a_row_is_that_of_the_paper() -> None:
    pos = np.zeros((1, 8))
    kernel.add_readings(pos, np.array([[0, 1]]), np.array([[0, 5]]), np.ones(1))
    assert np.allclose(pos[0], [0, -1, -15 / 16, -12 / 16, -7 / 16, 1, 0, 0])


def test_a_reading_in_the_sensors_own_cell_is_only_a_hit() -> None:
    pos = np.zeros((3, 3))
    kernel.add_readings(pos, np.array([[1, 1]]), np.array([[1, 1]]), np.ones(1))
    assert pos[1, 1] == 1.0
    assert np.count_nonzero(pos) == 1


@pytest.mark.parametrize("seed", range(3))
def test_shifted_sums_and_changes_agree_with_the_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((12, 17))
    cells = rng.integers(-6, 22, (30, 2))
    assert np.allclose(kernel.shifted_sums(values, cells, 4), reference.shifted_sums(values, cells, 4))
    changes = kernel.shifted_changes(values, cells, 4, -2, 3)
    assert np.allclose(changes, reference.shifted_changes(values, cells, 4, -2, 3))


def test_crossed_cells_agree_with_the_reference() -> None:
    rng = np.random.default_rng(0)
    origins, endpoints = rng.uniform(0, 20, (30, 2)), rng.uniform(0, 20, (30, 2))
    crossed, expected = np.zeros((20, 20)), np.zeros((20, 20))
    kernel.count_crossed(crossed, origins, endpoints)
    reference.count_crossed(expected, origins, endpoints)
    assert np.array_equal(crossed, expected)


def test_splats_keep_the_maximum_and_end_at_the_border() -> None:
    values = np.zeros((5, 5))
    splat = np.array([[0.1, 0.5, 0.1], [0.5, 1.0, 0.5], [0.1, 0.5, 0.1]])
    kernel.splat_maximum(values, np.array([[0, 0], [0, 1], [9, 9]]), splat, np.ones(3))
    assert np.allclose(values[:2, :3], [[1.0, 1.0, 0.5], [0.5, 0.5, 0.1]])
    assert values[2:].sum() == 0.0


def test_splats_agree_with_the_reference() -> None:
    rng = np.random.default_rng(2)
    values, cells = rng.random((20, 25)), rng.integers(-3, 28, (40, 2))
    splat, weights, expected = rng.random((5, 5)), rng.uniform(0.2, 1.5, 40), values.copy()
    kernel.splat_maximum(values, cells, splat, weights)
    reference.splat_maximum(expected, cells, splat, weights)
    assert np.allclose(values, expected)
