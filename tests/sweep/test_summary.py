"""Means, spreads, rates and their intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from gridslam.evaluation.gates import Value
from gridslam.sweep.job_result import JobResult, RunRow, State
from gridslam.sweep.summary import number_statistics, summarize, wilson_interval


def row(seed: int, config: str = "c", state: State = "done", **measures: Value) -> RunRow:
    found = {key.replace("__", "."): value for key, value in measures.items()}
    return RunRow("log", config, "default", seed, JobResult(state, measures=found), found)


@pytest.mark.parametrize(
    ("hits", "n", "low", "high"),
    [  # R: prop.test(hits, n, correct = FALSE)$conf.int
        (10, 20, 0.2992980, 0.7007020),
        (0, 10, 0.0, 0.2775328),
        (10, 10, 0.7224672, 1.0),
        (1, 3, 0.06149194, 0.7923404),
    ],
)
def test_the_interval_of_a_rate_is_wilsons(hits: int, n: int, low: float, high: float) -> None:
    assert wilson_interval(hits, n) == pytest.approx((low, high), abs=1e-6)


def test_wilsons_interval_solves_its_equation() -> None:
    # Both ends p satisfy |hits/n - p| = z sqrt(p (1 - p) / n).
    z = stats.norm.ppf(0.975)
    for hits, n in ((3, 7), (19, 20), (1, 400)):
        for p in wilson_interval(hits, n):
            assert abs(hits / n - p) == pytest.approx(z * math.sqrt(p * (1 - p) / n), rel=1e-9)


def test_the_interval_of_a_mean_is_students() -> None:
    values = np.array([0.3, 1.2, 0.7, 0.9, 2.4])
    found = number_statistics(values.tolist())
    low, high = stats.t.interval(0.95, len(values) - 1, loc=values.mean(), scale=stats.sem(values))
    assert (found["mean_low"], found["mean_high"]) == pytest.approx((low, high), rel=1e-12)
    assert found["sd"] == pytest.approx(np.std(values, ddof=1))
    assert (found["min"], found["median"], found["max"]) == (0.3, 0.9, 2.4)


def test_one_value_has_a_mean_and_no_standard_deviation() -> None:
    found = number_statistics([2.0])
    assert found["mean"] == found["median"] == 2.0
    assert all(math.isnan(found[key]) for key in ("sd", "mean_low", "mean_high"))


def test_groups_are_those_of_log_config_and_override() -> None:
    rows = [row(seed, config, ape__trans=float(seed)) for config in ("a", "b") for seed in range(3)]
    first, second = summarize(rows)
    assert (first.config, second.config) == ("a", "b")
    assert first.measures["ape.trans"].statistic("mean") == 1.0
    assert first.measures["ape.trans"].n == 3


def test_a_value_that_is_absent_or_null_is_counted_as_missing() -> None:
    (group,) = summarize([row(0, x=1.0), row(1, x=None), row(2, y=3.0)])
    assert (group.measures["x"].n, group.measures["x"].missing) == (1, 2)
    assert (group.measures["y"].n, group.measures["y"].missing) == (1, 2)


def test_truth_values_become_rates_and_words_are_left_out() -> None:
    (group,) = summarize([row(0, found=True, unit="m"), row(1, found=False, unit="m")])
    assert group.measures["found"].statistic("rate") == 0.5
    assert group.measures["found"].statistic("mean") is None
    assert "unit" not in group.measures


def test_runs_not_tried_count_neither_as_done_nor_as_failed() -> None:
    (group,) = summarize([row(0, state="done"), row(1, state="failed"), row(2, state="not run")])
    assert (group.runs, group.done) == (3, 1)
    assert group.measures["run.done"].statistic("rate") == 0.5
    assert group.measures["run.done"].n == 2
