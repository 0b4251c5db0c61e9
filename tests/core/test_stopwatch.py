from __future__ import annotations

import time

import pytest

from gridslam.core.stopwatch import Stopwatch


def test_stages_add_up_and_one_within_another_counts_in_both() -> None:
    watch = Stopwatch()
    for _ in range(2):
        with watch.stage("outer"), watch.stage("inner"):
            time.sleep(0.002)
    assert 0.004 <= watch.seconds["inner"] <= watch.seconds["outer"]
    assert set(watch.seconds) == {"outer", "inner"}


def test_a_stage_that_fails_is_counted_all_the_same() -> None:
    watch = Stopwatch()
    with pytest.raises(ValueError, match="no"), watch.stage("failing"):
        raise ValueError("no")
    assert watch.seconds["failing"] > 0.0
