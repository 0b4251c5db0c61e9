from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from tests.benchmarks import harness
from tests.benchmarks.harness import (
    HERE,
    BenchmarkRow,
    benchmarks,
    bounded,
    module_of,
    read_bounds,
    table,
    without_row,
)
from tests.benchmarks.machine import slowness


def test_a_bound_holds_from_both_sides() -> None:
    assert BenchmarkRow("t", 1.0, "s", bound=1.0).holds
    assert not BenchmarkRow("t", 1.1, "s", bound=1.0).holds
    assert BenchmarkRow("r", 5.0, "1/s", bound=4.0, at_least=True).holds
    assert not BenchmarkRow("r", 3.0, "1/s", bound=4.0, at_least=True).holds
    assert BenchmarkRow("x", 3.0, "m").holds
    assert not BenchmarkRow("x", math.nan, "m").holds


def test_every_benchmark_can_be_run() -> None:
    assert all(callable(module_of(name).rows) for name in benchmarks())


def test_the_file_sets_bounds_by_name() -> None:
    row = bounded(BenchmarkRow("a.rate", 3.0, "1/s"), {"a.rate": {"at_least": 4}})
    assert (row.bound, row.at_least, row.holds) == (4.0, True, False)
    assert "VIOLATED" in table([row])


def test_times_and_rates_have_other_bounds_on_a_slower_machine() -> None:
    bounds = {name: {"at_most": 4} for name in ("a", "b", "c")}
    units = {"a": "s", "b": "1/s", "c": "m"}
    found = {
        name: bounded(BenchmarkRow(name, 5.0, unit), bounds, slower=2.0).bound for name, unit in units.items()
    }
    assert found == {"a": 8.0, "b": 2.0, "c": 4.0}
    assert bounded(BenchmarkRow("d", 5.0, "ms a scan", bound=4.0), {}, slower=2.0).bound == 8.0
    assert 1.0 <= slowness() < 100.0


def test_a_malformed_bound_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "bounds.yaml"
    for bound in ("3", "{at_most: 3, at_least: 1}", "{most: 3}", "{at_most: three}"):
        file.write_text(f"b:\n  a: {bound}\n")
        with pytest.raises(ValueError, match="at_most"):
            read_bounds(file)


def test_the_stored_bounds_are_well_formed_and_belong_to_benchmarks() -> None:
    bounds = read_bounds(HERE / "bounds.yaml")
    assert bounds.keys() <= set(benchmarks())
    assert all(bounds.values())


def test_a_bound_without_its_row_is_reported_where_the_benchmark_gave_others() -> None:
    bounds = {"cli": {"a": {"limit": 1.0}, "b": {"limit": 1.0}}, "plan": {"c": {"limit": 1.0}}}
    assert without_row(bounds, {"cli": {"a"}}) == ["cli: b"]
    assert without_row(bounds, {"cli": {"a", "b"}}) == []
    assert without_row(bounds, {"cli": {"a", "b"}, "plan": set()}) == []
    assert without_row({"gone": {"a": {"limit": 1.0}}}, {}) == ["gone: a"]


@pytest.mark.parametrize(
    ("name", "value", "code", "says"),
    [
        ("cli.help", 0.5, 0, ""),
        ("cli.help", 1.5, 1, "VIOLATED"),
        ("cli.helps", 0.5, 1, "bounds.yaml: cli: cli.help: no such row"),
    ],
)
def test_a_broken_bound_or_one_without_its_row_ends_with_1(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    value: float,
    code: int,
    says: str,
) -> None:
    (tmp_path / "bounds.yaml").write_text("cli:\n  cli.help: {at_most: 0.8}\nplan:\n  x: {at_most: 1}\n")
    (tmp_path / "bench_cli.py").touch()
    (tmp_path / "bench_plan.py").touch()
    monkeypatch.setattr(harness, "HERE", tmp_path)
    monkeypatch.setattr("tests.benchmarks.bench_cli.rows", lambda: [BenchmarkRow(name, value, "ratio")])
    monkeypatch.setattr("tests.benchmarks.bench_plan.rows", list)
    assert harness.main(["--jobs", "1"]) == code
    out, err = capsys.readouterr()
    assert says in out + err


class _Pool:
    """A pool that does its work in this process, at once."""

    def __init__(self, jobs: int, mp_context: object) -> None:
        self.jobs = jobs

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def submit(self, call: Callable[[str], list[BenchmarkRow]], name: str) -> Future[list[BenchmarkRow]]:
        future: Future[list[BenchmarkRow]] = Future()
        future.set_result(call(name))
        return future


@pytest.mark.parametrize(
    ("jobs", "alone", "together"),
    [(1, ["plan", "cli", "wean_hall"], []), (2, ["cli"], ["plan", "wean_hall"])],
)
def test_a_benchmark_that_measures_by_the_clock_runs_before_the_others_use_all_cores(
    monkeypatch: pytest.MonkeyPatch, jobs: int, alone: list[str], together: list[str]
) -> None:
    monkeypatch.setattr(harness, "rows_of", lambda name: [BenchmarkRow(name, 1.0, "s")])
    monkeypatch.setattr(harness, "ProcessPoolExecutor", _Pool)
    found = [name for name, _ in harness.measure(["plan", "bench_cli", "wean_hall"], jobs)]
    assert found[: len(alone)] == alone
    assert sorted(found[len(alone) :]) == together  # in the order in which they end


def test_a_benchmark_that_fails_is_named_and_the_others_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Failing:
        ALONE = True

        @staticmethod
        def rows() -> Iterator[BenchmarkRow]:
            yield BenchmarkRow("first", 1.0, "s")
            raise RuntimeError("no more")

    class Whole:
        ALONE = True

        @staticmethod
        def rows() -> Iterator[BenchmarkRow]:
            yield BenchmarkRow("second", 2.0, "s")

    modules = {"plan": Failing, "wean_hall": Whole}
    monkeypatch.setattr(harness, "module_of", modules.__getitem__)
    monkeypatch.setattr(harness, "read_bounds", lambda path: {})
    monkeypatch.setattr(harness, "slowness", lambda: 1.0)
    assert harness.main(["plan", "wean_hall"]) == 1
    shown = capsys.readouterr()
    assert "first" in shown.out and "second" in shown.out
    assert "RuntimeError: no more" in shown.err and "plan: failed" in shown.err
