"""Bounds on runs and on groups of runs."""

from __future__ import annotations

import pytest

from gridslam.core.errors import ConfigError
from gridslam.sweep.gates import failed_gates, parse_sweep_gate
from gridslam.sweep.summary import summarize
from tests.sweep.test_summary import row

ROWS = [row(0, "a", err=0.1, ok=True), row(1, "a", err=0.3, ok=False), row(0, "b", err=0.2, ok=True)]


def failures(text: str, config: str | None = None) -> list[str]:
    return failed_gates([parse_sweep_gate(text, config=config)], ROWS, summarize(ROWS))


def test_a_bound_holds_for_every_run() -> None:
    assert failures("err<=0.3") == []
    assert failures("err<=0.25") == ["log a default seed 1: gate failed: err = 0.3, required <= 0.25"]


def test_a_statistic_holds_for_every_group() -> None:
    assert failures("mean(err)<=0.2") == []
    assert failures("max( err ) < 0.25") == ["log a default: gate failed: max of err = 0.3, required < 0.25"]
    assert failures("rate(ok)>=0.9") == ["log a default: gate failed: rate of ok = 0.5, required >= 0.9"]
    assert failures("rate_low(ok)>=0.01") == []


def test_a_bound_may_concern_some_of_the_runs() -> None:
    assert failures("err<=0.25", config="b") == []
    assert len(failures("err<=0.15", config="b")) == 1


def test_what_has_no_value_meets_no_bound() -> None:
    assert len(failures("no.such.key<=9")) == 3
    assert len(failures("mean(no.such.key)<=9")) == 2
    assert len(failures("sd(err)<=9")) == 1, "one run has no spread"


def test_runs_that_failed_are_not_asked_but_somebody_must_be() -> None:
    rows = [row(0, state="failed")]
    gates = [parse_sweep_gate("err<=1")]
    assert failed_gates(gates, rows, summarize(rows)) == ["gate failed: err<=1: it applies to no run"]


@pytest.mark.parametrize(
    ("text", "message"),
    [("meen(err)<=1", "did you mean 'mean'"), ("err", "expected KEY<=NUMBER"), ("mean(err)", "expected KEY")],
)
def test_what_is_no_bound_is_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_sweep_gate(text)
