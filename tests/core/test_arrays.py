from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.arrays import cumulative_distance, evenly_spaced, offsets_of


@pytest.mark.parametrize(("n", "count"), [(0, 5), (3, 5), (5, 5), (10, 3), (1000, 7), (4, 0)])
def test_evenly_spaced_items_are_distinct_and_from_the_whole_range(n: int, count: int) -> None:
    chosen = evenly_spaced(n, count)
    assert len(chosen) == min(n, count) == len(set(chosen.tolist()))
    if len(chosen):
        assert chosen[0] == 0
        assert n - chosen[-1] <= n / len(chosen) + 1
    gaps = np.diff(chosen).tolist()
    assert not gaps or max(gaps) - min(gaps) <= 1


def test_offsets_are_where_groups_begin_and_the_last_one_ends() -> None:
    assert offsets_of([2, 0, 3]).tolist() == [0, 2, 2, 5]
    assert offsets_of([]).tolist() == [0]
    assert offsets_of(np.array([1, 1])).dtype == np.int64


def test_the_distance_along_a_path_ignores_the_heading() -> None:
    poses = np.array([[0.0, 0.0, 1.0], [3.0, 4.0, 2.0], [3.0, 5.0, -2.0]])
    assert cumulative_distance(poses).tolist() == [0.0, 5.0, 6.0]
    assert cumulative_distance(poses[:1, :2]).tolist() == [0.0]
