from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import on_threads, run_in_ranges


@compiled
def _squares(first: int, last: int, values: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(first, last):
        if values[i] < 0.0:
            raise ValueError("negative")
        out[i] += values[i] * values[i]


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 7, 1000])
def test_every_item_is_done_once(threads: int, count: int) -> None:
    values = np.arange(float(count))
    out = np.zeros(count)
    with on_threads(threads):
        run_in_ranges(_squares, count, (values, out))
    np.testing.assert_array_equal(out, values**2)


def test_an_error_in_a_thread_is_raised() -> None:
    values = np.ones(100)
    run_in_ranges(_squares, 1, (values, np.zeros(100)))
    values[70] = -1.0
    with on_threads(3), pytest.raises(ValueError, match="negative"):
        run_in_ranges(_squares, 100, (values, np.zeros(100)))
