"""Beam insertion against its reference implementation."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.grids import log_odds
from gridslam.kernels.grids.tiles import ScanSet
from gridslam.maps.tiled import TileStore
from tests.reference import log_odds as reference

HIT, MISS, LIMIT = 0.9, -0.4, 2.0
UPDATE = log_odds.LogOddsUpdate(HIT, MISS, LIMIT)

# Away from grid lines and corners, where a beam belongs to either cell by rounding alone.
coordinate = st.integers(-400, 400).map(lambda i: i / 10.0 + 0.0317)
endpoints = st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=12)


def inserted(origin: tuple[float, float], points: list[tuple[float, float]]) -> TileStore:
    store = TileStore(2, 1, 1.0)
    pose, viewpoint = np.zeros(3), np.array(origin)
    array = np.array(points)
    store.own_beams(np.array([0]), pose[None], viewpoint, array)
    log_odds.insert_beams(store.map(0), pose, log_odds.BeamBundle(viewpoint, array), UPDATE)
    return store


def as_cells(store: TileStore, index: int = 0) -> dict[tuple[int, int], float]:
    values, (row, col) = store.dense(index)
    return {
        (int(r) + row, int(c) + col): float(values[r, c, 0]) for r, c in np.argwhere(values[..., 0] != 0.0)
    }


@given(origin=st.tuples(st.just(0.513), st.just(0.487)), points=endpoints)
@settings(max_examples=150, deadline=None)
def test_every_crossed_cell_gets_a_miss_and_every_endpoint_a_hit(
    origin: tuple[float, float], points: list[tuple[float, float]]
) -> None:
    expected: dict[tuple[int, int], float] = {}
    reference.insert(expected, *origin, points, HIT, MISS, LIMIT)
    found = as_cells(inserted(origin, points))
    expected = {cell: value for cell, value in expected.items() if abs(value) > 1e-6}
    found = {cell: value for cell, value in found.items() if abs(value) > 1e-6}
    assert found.keys() == expected.keys()
    for cell, value in expected.items():
        assert abs(found[cell] - value) < 1e-5


def test_the_map_of_another_particle_remains_empty() -> None:
    assert as_cells(inserted((0.5, 0.5), [(5.2, 3.1)]), 1) == {}


def test_inserting_many_scans_equals_inserting_them_one_by_one() -> None:
    rng = np.random.default_rng(3)
    points, first_point = rng.uniform(-8.0, 8.0, (30, 2)), np.array([0, 10, 10, 30])
    poses, viewpoint = rng.uniform(-2.0, 2.0, (3, 3)), np.array([0.1, -0.2])
    store = TileStore(2, 1, 0.2)
    scans = ScanSet(points, np.zeros_like(points), first_point)
    store.own_scans(0, poses, viewpoint, scans, with_beams=True)
    log_odds.insert_beams_of_scans(store.map(0), poses, viewpoint, scans, UPDATE)
    for pose, lo, hi in zip(poses, first_point, first_point[1:], strict=False):
        own = points[lo:hi]
        store.own_beams(np.array([1]), pose[None], viewpoint, own)
        log_odds.insert_beams(store.map(1), pose, log_odds.BeamBundle(viewpoint, own), UPDATE)
    assert as_cells(store, 0) == as_cells(store, 1)


@given(points=endpoints)
@settings(max_examples=60, deadline=None)
def test_a_scan_changes_a_cell_of_the_dense_map_at_most_once_and_a_hit_overrides_a_miss(
    points: list[tuple[float, float]],
) -> None:
    values, last_update = np.full((90, 90), np.nan, np.float32), np.zeros((90, 90), np.uint8)
    origin, array = np.array([45.513, 45.487]), np.array(points) + 45.0
    beams, is_hit = log_odds.BeamBundle(origin, array), np.ones(len(array), np.bool_)
    log_odds.insert_scan_dense(values, last_update, 1, beams, is_hit, UPDATE)
    cells: dict[tuple[int, int], float] = {}
    reference.insert_once(cells, *origin.tolist(), [(x, y) for x, y in array.tolist()], HIT, MISS, LIMIT)
    expected = np.full((90, 90), np.nan, np.float32)
    for cell, value in cells.items():
        expected[cell] = value
    np.testing.assert_allclose(values, expected, atol=1e-6)
