"""Stamps that jitter about even ones are evened; those of messages that were made unevenly are not."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.logs.order.even_stamps import evened

NS = 10**9
TRUE_S = 0.05 * np.arange(1000) + 7.0


def stamps_of(seconds: np.ndarray) -> np.ndarray:
    return np.round(seconds * NS).astype(np.int64)


def test_jitter_on_both_sides_is_removed() -> None:
    noisy = stamps_of(TRUE_S + np.random.default_rng(0).normal(0.0, 0.08, 1000))
    found = evened(noisy)
    assert found is not None
    np.testing.assert_allclose(found[0] * 1e-9, TRUE_S, atol=0.02)
    assert found[1] == pytest.approx(0.08, rel=0.1)


def test_delays_of_a_queue_are_removed_from_the_earliest_ones_on() -> None:
    late = TRUE_S + np.random.default_rng(1).exponential(0.04, 1000)
    found = evened(stamps_of(np.maximum.accumulate(late)))
    assert found is not None
    np.testing.assert_allclose(found[0] * 1e-9, TRUE_S, atol=0.02)


@pytest.mark.parametrize("kind", ["even", "random", "pauses", "missing", "set_back", "few", "constant"])
def test_other_stamps_are_left_as_they_are(kind: str) -> None:
    rng = np.random.default_rng(2)
    jitter = rng.normal(0.0, 0.04, 1000)
    seconds = {
        "even": TRUE_S + 0.1 * jitter,
        "random": 7.0 + np.cumsum(rng.exponential(0.05, 1000)),
        "pauses": TRUE_S + jitter + 3.0 * (np.arange(1000) // 300),
        "missing": np.delete(TRUE_S + jitter, rng.choice(1000, 100, replace=False)),
        "set_back": TRUE_S + jitter - 5.0 * (np.arange(1000) > 500),
        "few": (TRUE_S + jitter)[:200],
        "constant": np.full(1000, 7.0),
    }[kind]
    assert evened(stamps_of(seconds)) is None
