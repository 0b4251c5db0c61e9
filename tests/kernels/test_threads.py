from __future__ import annotations

from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.kernels import threads
from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import on_threads, run_in_ranges


@compiled
def _squares(first: int, last: int, values: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(first, last):
        if values[i] < 0.0:
            raise ValueError("negative")
        out[i] += values[i] * values[i]


@pytest.mark.parametrize("number", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 7, 1000])
@pytest.mark.parametrize("smallest", [1, 300])
def test_every_item_is_done_once(number: int, count: int, smallest: int) -> None:
    values = np.arange(float(count))
    out = np.zeros(count)
    with on_threads(number):
        run_in_ranges(_squares, count, (values, out), smallest)
    np.testing.assert_array_equal(out, values**2)


def test_an_error_in_a_thread_is_raised() -> None:
    values = np.ones(100)
    run_in_ranges(_squares, 1, (values, np.zeros(100)))
    values[70] = -1.0
    with on_threads(3), pytest.raises(ValueError, match="negative"):
        run_in_ranges(_squares, 100, (values, np.zeros(100)))


def test_a_signal_ends_the_work_before_its_last_range(monkeypatch: pytest.MonkeyPatch) -> None:
    run_in_ranges(_squares, 1, (np.ones(1), np.zeros(1)))
    futures = [Future() for _ in range(16)]
    futures[0].set_exception(KeyboardInterrupt())
    submitted = iter(futures)
    pool = SimpleNamespace(submit=lambda *_: next(submitted))
    monkeypatch.setattr(threads, "_pool", lambda *_: pool)
    with on_threads(2), pytest.raises(KeyboardInterrupt):
        run_in_ranges(_squares, 100, (np.ones(100), np.zeros(100)))
    assert all(future.cancelled() for future in futures[1:])
