"""Copy-on-write maps behave as if each had cells of its own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core.errors import MethodError
from gridslam.kernels.grids import log_odds
from gridslam.maps.tiled import TileStore

MAPS = 4
CELL_M = 0.5


def hit(store: TileStore, index: int, x: float, y: float) -> None:
    """Add 1 to one cell of one map."""
    pose, point = np.zeros(3), np.array([[x, y]])
    store.own_endpoints(np.array([index]), pose[None], point)
    beams, update = log_odds.BeamBundle(point[0], point), log_odds.LogOddsUpdate(1.0, -1.0, 100.0)
    log_odds.insert_beams(store.map(index), pose, beams, update)


def cells_of(store: TileStore, index: int) -> dict[tuple[int, int], float]:
    values, (row, col) = store.dense(index)
    return {(int(r) + row, int(c) + col): float(values[r, c, 0]) for r, c in np.argwhere(values[..., 0] != 0)}


operation = st.one_of(
    st.tuples(st.just("hit"), st.integers(0, MAPS - 1), st.integers(-60, 60), st.integers(-60, 60)),
    st.tuples(st.just("resample"), st.lists(st.integers(0, MAPS - 1), min_size=MAPS, max_size=MAPS)),
    st.tuples(st.just("clear"), st.integers(0, MAPS - 1)),
)


@given(operations=st.lists(operation, max_size=40))
@settings(max_examples=80, deadline=None)
def test_maps_never_see_each_others_writes(operations: list[tuple]) -> None:
    store = TileStore(MAPS, 1, CELL_M)
    expected: list[dict[tuple[int, int], float]] = [{} for _ in range(MAPS)]
    for name, *arguments in operations:
        if name == "hit":
            index, row, col = arguments
            hit(store, index, (col + 0.5) * CELL_M, (row + 0.5) * CELL_M)
            expected[index][row, col] = expected[index].get((row, col), 0.0) + 1.0
        elif name == "clear":
            store.clear(arguments[0])
            expected[arguments[0]] = {}
        else:
            # As in residual resampling, survivors keep their index.
            chosen = arguments[0]
            ancestors = np.array([i if i in chosen else chosen[0] for i in range(MAPS)])
            store.redistribute(ancestors)
            expected = [dict(expected[a]) for a in ancestors]
    for index in range(MAPS):
        assert cells_of(store, index) == expected[index]
    held = store.directory[store.directory >= 0]
    np.testing.assert_array_equal(np.bincount(held, minlength=len(store.refcount)), store.refcount)
    assert store.tiles_in_use == len(np.unique(held))


def test_a_pose_far_away_is_an_error_before_it_exhausts_memory() -> None:
    store = TileStore(30, 1, 0.05, memory_limit_mb=50.0)
    with pytest.raises(MethodError, match="memory_limit_mb"):
        store.own_endpoints(np.array([0]), np.array([[0.0, 0.0, 0.0], [1e6, 1e6, 0.0]]), np.ones((3, 2)))


def test_a_pose_that_is_not_finite_is_an_error() -> None:
    store = TileStore(1, 1, 0.05)
    with pytest.raises(MethodError, match="not finite"):
        store.own_endpoints(np.array([0]), np.array([[np.nan, 0.0, 0.0]]), np.ones((3, 2)))
