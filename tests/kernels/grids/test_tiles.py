"""Copy-on-write tiles against maps that share nothing, and the tiles of scans against geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core import poses as se2
from gridslam.kernels.grids.tiles import (
    TILE_CELLS,
    TilePool,
    mark_beam_tiles,
    mark_endpoint_tiles,
    own_tiles,
    redistribute,
)
from tests.reference.tiles import IndependentMaps, crosses, endpoint_tiles

MAPS, ROWS, COLS, CAPACITY = 4, 3, 5, 4 * 3 * 5
TILE_SHAPE = (TILE_CELLS, TILE_CELLS, 2)
RESOLUTION = 0.1
TILE_M = RESOLUTION * TILE_CELLS
ORIGIN = np.array([-6, -7])
WANTED_SHAPE = (12, 14)


def assert_same(maps: IndependentMaps, directory: np.ndarray, pool: TilePool, n_free: int) -> None:
    """Every map has the tiles and values of the reference; counts and free tiles agree with the directory."""
    for index, expected in enumerate(maps.maps):
        held = {
            tuple(cell): directory[index][tuple(cell)] for cell in np.argwhere(directory[index] >= 0).tolist()
        }
        assert held.keys() == expected.keys()
        for cell, tile in held.items():
            np.testing.assert_array_equal(pool.tiles[tile], expected[cell])
    used = directory[directory >= 0]
    counts = np.bincount(used, minlength=CAPACITY)
    np.testing.assert_array_equal(pool.refcount[counts > 0], counts[counts > 0])
    assert set(pool.free[:n_free].tolist()) == set(np.flatnonzero(counts == 0).tolist())


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_maps_behave_as_if_they_shared_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    directory = np.full((MAPS, ROWS, COLS), -1, np.int32)
    pool = TilePool(
        np.full((CAPACITY, *TILE_SHAPE), np.nan, np.float32),
        np.zeros(CAPACITY, np.int32),
        np.arange(CAPACITY, dtype=np.int32),
    )
    n_free = CAPACITY
    maps = IndependentMaps(MAPS)
    for _ in range(12):
        if rng.random() < 0.3:
            ancestors = rng.integers(MAPS, size=MAPS)
            # A map that survives keeps its own index, as systematic resampling arranges it.
            for ancestor in set(ancestors.tolist()):
                ancestors[ancestor] = ancestor
            n_free = redistribute(directory, ancestors, pool, n_free)
            maps.redistribute(ancestors.tolist())
        else:
            index, wanted = int(rng.integers(MAPS)), rng.random((ROWS, COLS)) < 0.3
            tiles = [(int(row), int(col)) for row, col in np.argwhere(wanted)]
            n_free = own_tiles(wanted, directory[index], pool, n_free)
            assert not wanted.any()
            maps.own(index, tiles, TILE_SHAPE)
            for tile in tiles:
                values = rng.random(TILE_SHAPE).astype(np.float32)
                pool.tiles[directory[index][tile]] = values
                maps.maps[index][tile][:] = values
        assert_same(maps, directory, pool, n_free)


def marked(wanted: np.ndarray) -> set[tuple[int, int]]:
    return {(int(row), int(col)) for row, col in np.argwhere(wanted) + ORIGIN}


def in_window(tile: tuple[int, int]) -> bool:
    return all(0 <= tile[k] - ORIGIN[k] < WANTED_SHAPE[k] for k in range(2))


@pytest.mark.parametrize("seed", range(5))
def test_endpoint_tiles_are_those_that_contain_the_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose, points = rng.uniform(-2.0, 2.0, 3), rng.uniform(-6.0, 6.0, (40, 2))
    wanted = np.zeros(WANTED_SHAPE, bool)
    mark_endpoint_tiles(wanted, ORIGIN, pose, points, RESOLUTION)
    assert marked(wanted) == {tile for tile in endpoint_tiles(pose, points, RESOLUTION) if in_window(tile)}


@pytest.mark.parametrize("seed", range(5))
def test_beam_tiles_are_those_that_the_beams_cross(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose, viewpoint, points = (
        rng.uniform(-2.0, 2.0, 3),
        np.array([0.2, -0.1]),
        rng.uniform(-6.0, 6.0, (10, 2)),
    )
    wanted = np.zeros(WANTED_SHAPE, bool)
    mark_beam_tiles(wanted, ORIGIN, pose, viewpoint, points, RESOLUTION)
    start = se2.transform_points(pose, viewpoint[None])[0]
    ends = se2.transform_points(pose, points)
    found = marked(wanted)
    for row, col in np.ndindex(*WANTED_SHAPE):
        tile = row + int(ORIGIN[0]), col + int(ORIGIN[1])
        if any(crosses(start, end, tile, TILE_M, slack_m=-1e-6) for end in ends):
            assert tile in found
        elif not any(crosses(start, end, tile, TILE_M, slack_m=1e-6) for end in ends):
            assert tile not in found
