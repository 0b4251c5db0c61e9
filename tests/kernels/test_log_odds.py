"""Insertion of beams against its slow reference."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels import log_odds
from gridslam.maps.tiled import TileStore
from tests.reference import log_odds as reference

HIT, MISS, LIMIT = 0.9, -0.4, 2.0

# Away from grid lines and corners, where a beam belongs to either cell by rounding alone.
coordinate = st.integers(-400, 400).map(lambda i: i / 10.0 + 0.0317)
ends = st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=12)


def inserted(eye: tuple[float, float], points: list[tuple[float, float]]) -> TileStore:
    store = TileStore(2, 1, 1.0)
    pose, viewpoint = np.zeros(3), np.array(eye)
    array = np.array(points)
    store.own_beams(np.array([0]), pose[None], viewpoint, array)
    log_odds.insert_beams(
        store.directory[0], store.pool, store.origin, 1.0, pose, viewpoint, array, HIT, MISS, LIMIT
    )
    return store


def as_cells(store: TileStore, index: int = 0) -> dict[tuple[int, int], float]:
    values, (row, col) = store.dense(index)
    return {
        (int(r) + row, int(c) + col): float(values[r, c, 0]) for r, c in np.argwhere(values[..., 0] != 0.0)
    }


@given(eye=st.tuples(st.just(0.513), st.just(0.487)), points=ends)
@settings(max_examples=150, deadline=None)
def test_every_crossed_cell_gets_a_miss_and_every_end_a_hit(
    eye: tuple[float, float], points: list[tuple[float, float]]
) -> None:
    expected: dict[tuple[int, int], float] = {}
    reference.insert(expected, *eye, points, HIT, MISS, LIMIT)
    found = as_cells(inserted(eye, points))
    expected = {cell: value for cell, value in expected.items() if abs(value) > 1e-6}
    found = {cell: value for cell, value in found.items() if abs(value) > 1e-6}
    assert found.keys() == expected.keys()
    for cell, value in expected.items():
        assert abs(found[cell] - value) < 1e-5


def test_the_map_of_another_particle_stays_empty() -> None:
    assert as_cells(inserted((0.5, 0.5), [(5.2, 3.1)]), 1) == {}


def test_a_trail_is_the_same_as_its_scans_one_by_one() -> None:
    rng = np.random.default_rng(3)
    points, first = rng.uniform(-8.0, 8.0, (30, 2)), np.array([0, 10, 10, 30])
    poses, eye = rng.uniform(-2.0, 2.0, (3, 3)), np.array([0.1, -0.2])
    store = TileStore(2, 1, 0.2)
    store.own_trail(0, poses, eye, points, first, with_beams=True)
    log_odds.insert_beam_trail(
        store.directory[0], store.pool, store.origin, 0.2, poses, eye, points, first, HIT, MISS, LIMIT
    )
    for pose, lo, hi in zip(poses, first, first[1:], strict=False):
        own = points[lo:hi]
        store.own_beams(np.array([1]), pose[None], eye, own)
        log_odds.insert_beams(
            store.directory[1], store.pool, store.origin, 0.2, pose, eye, own, HIT, MISS, LIMIT
        )
    assert as_cells(store, 0) == as_cells(store, 1)


@given(points=ends)
@settings(max_examples=60, deadline=None)
def test_one_scan_changes_a_cell_of_the_dense_map_once_and_a_hit_wins(
    points: list[tuple[float, float]],
) -> None:
    values, touched = np.zeros((90, 90), np.float32), np.zeros((90, 90), np.int32)
    eye, array = np.array([45.513, 45.487]), np.array(points) + 45.0
    log_odds.insert_scan_dense(
        values, touched, 1, eye, array, np.ones(len(array), np.bool_), HIT, MISS, LIMIT
    )
    cells: dict[tuple[int, int], float] = {}
    reference.insert_once(cells, *eye.tolist(), [(x, y) for x, y in array.tolist()], HIT, MISS, LIMIT)
    expected = np.zeros((90, 90), np.float32)
    for cell, value in cells.items():
        expected[cell] = value
    np.testing.assert_allclose(values, expected, atol=1e-6)
