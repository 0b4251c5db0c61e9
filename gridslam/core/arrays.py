"""Small operations on arrays that many modules share."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


def evenly_spaced(n: int, max_count: int) -> Ints:
    """Indices of at most `max_count` of n items, evenly distributed; all of them if there are no more."""
    count = min(n, max_count)
    return (np.arange(count, dtype=np.int64) * n) // max(count, 1)


def evenly_to_the_last(n: int, max_count: int) -> Ints:
    """Indices of at most `max_count` of n items, evenly distributed, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, max_count)).astype(np.int64))


def offsets_of(counts: Iterable[int]) -> Ints:
    """Start indices of n consecutive groups with the given sizes, and the end of the last group, `(n + 1,)`."""
    return np.concatenate([[0], np.cumsum(np.fromiter(counts, np.int64))])


def cumulative_distance(points: Floats) -> Floats:
    """Distance along the path `(n,)` from its first point to each of the points or poses `(n, 2)` or `(n, 3)`, in their unit."""
    steps = np.diff(points[:, :2], axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
