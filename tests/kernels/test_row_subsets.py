"""Rows of one array within another, in their order."""

from __future__ import annotations

import numpy as np

from gridslam.kernels.row_subsets import rows_in_order


def test_the_rows_of_a_subset_are_found_in_order() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        rows = np.flatnonzero(rng.random(60) < 0.5)
        values = rng.integers(0, 1000, (60, 2)).astype(float)
        assert rows_in_order(values[rows], values).tolist() == rows.tolist()


def test_what_does_not_follow_ends_the_search() -> None:
    values = np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])
    assert rows_in_order(values[[2, 0]], values).tolist() == [2]
    assert rows_in_order(np.array([[0.0, 1.5]]), values).tolist() == []
    assert rows_in_order(values[:0], values).tolist() == []


def test_of_equal_rows_each_is_taken_once() -> None:
    values = np.array([[1.0, 1.0], [1.0, 1.0], [2.0, 2.0]])
    assert rows_in_order(values, values).tolist() == [0, 1, 2]
