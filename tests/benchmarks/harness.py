"""Benchmarks: every `bench_*.py` beside this file gives rows, `bounds.yaml` says what they may not exceed.

Run with `make bench`, or `python -m tests.benchmarks.harness [--jobs N] [NAME ...]` for single files. A file exposes `rows() ->
Iterable[BenchmarkRow]`. One that says `ALONE = True` measures by the clock, and runs while nothing else does; the others share
the cores, each in a process of its own. A benchmark whose data is not there gives no rows and says so on stderr. One that gives
any must give all rows that have bounds: so a row that is renamed does not lose its bound unnoticed. Bounds in seconds are for
the machine of `machine.py`; on a slower one they are longer, by what is measured before and after the benchmark.
"""

from __future__ import annotations

import argparse
import importlib
import math
import multiprocessing
import os
import sys
import time
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import yaml

from gridslam.core.threads import threads_each
from tests.benchmarks.machine import bound_here, slowness

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True, slots=True)
class BenchmarkRow:
    """A measured figure with its bound: the largest allowed value, or with `at_least` the smallest."""

    name: str
    value: float
    unit: str
    bound: float | None = None
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether the bound holds; NaN fails every bound."""
        if math.isnan(self.value):
            return False
        if self.bound is None:
            return True
        return self.value >= self.bound if self.at_least else self.value <= self.bound


class Measured(NamedTuple):
    """The rows of a benchmark, and how many times as long as the reference machine this one took for the same work.

    `failure` is what ended it before all rows were there, with the lines of code; empty if nothing did.
    """

    rows: list[BenchmarkRow]
    slower: float
    failure: str = ""


Bounds = Mapping[str, Mapping[str, float]]  # of one benchmark, by the name of the row


def benchmarks() -> list[str]:
    """The names of all benchmarks."""
    return sorted(path.stem.removeprefix("bench_") for path in HERE.glob("bench_*.py"))


def read_bounds(path: Path) -> dict[str, Bounds]:
    """The bounds by benchmark: `row: {at_most: x}` or `row: {at_least: x}`."""
    document = yaml.safe_load(path.read_text()) or {}
    for benchmark, bounds in document.items():
        for name, bound in bounds.items():
            if (
                not isinstance(bound, dict)
                or len(bound) != 1
                or not {"at_most", "at_least"} >= set(bound)
                or not all(isinstance(value, int | float) for value in bound.values())
            ):
                raise ValueError(
                    f"{path}: {benchmark}: {name}: expected {{at_most: NUMBER}} or {{at_least: NUMBER}}, got {bound!r}"
                )
    return document


def bounded(row: BenchmarkRow, bounds: Bounds, slower: float = 1.0) -> BenchmarkRow:
    """The row with the bound of the file, if there is one, instead of its own, on a machine that is slower by the factor."""
    if row.name in bounds:
        ((kind, value),) = bounds[row.name].items()
        row = replace(row, bound=float(value), at_least=kind == "at_least")
    return row if row.bound is None else replace(row, bound=bound_here(row.bound, row.unit, slower))


def without_row(bounds: Mapping[str, Bounds], found: Mapping[str, Collection[str]]) -> list[str]:
    """The bounds without a row, as `benchmark: row`, given the names of the rows of each benchmark.

    A benchmark that has given none, or was not run, has nothing to meet; one that does not exist has lost its bounds.
    """
    return [
        f"{benchmark}: {name}"
        for benchmark, rows in bounds.items()
        for name in rows
        if benchmark not in benchmarks() or (found.get(benchmark) and name not in found[benchmark])
    ]


def measure(names: Sequence[str], jobs: int) -> Iterator[tuple[str, Measured]]:
    """The names and rows of the named benchmarks, or of all, each as soon as it is done.

    First those that run alone, then the others on several processes.
    """
    known = benchmarks()
    chosen = [name.removeprefix("bench_") for name in names] or known
    for name in chosen:
        if name not in known:
            raise SystemExit(f"no benchmark {name!r}; there are: {', '.join(known)}")
    alone = [name for name in chosen if jobs == 1 or getattr(module_of(name), "ALONE", False)]
    for name in alone:
        yield name, rows_of(name)
    together = [name for name in chosen if name not in alone]
    if together:
        spawn = multiprocessing.get_context("spawn")
        with threads_each(1), ProcessPoolExecutor(jobs, mp_context=spawn) as pool:
            running = {pool.submit(rows_of, name): name for name in together}
            for done in as_completed(running):
                yield running[done], done.result()


def module_of(name: str) -> ModuleType:
    """The module of a benchmark."""
    return importlib.import_module(f"tests.benchmarks.bench_{name}")


def rows_of(name: str) -> Measured:
    """All rows of a benchmark, or those before it failed; prints how long it took."""
    started, slower = time.perf_counter(), slowness()
    rows: list[BenchmarkRow] = []
    failure = ""
    try:
        rows.extend(module_of(name).rows())
    except Exception:  # the others go on
        failure = traceback.format_exc()
    slower = max(slower, slowness())
    say(f"{name}: {time.perf_counter() - started:.1f} s, on {slower:.2f} of the reference machine's time")
    return Measured(rows, slower, failure)


def say(line: str) -> None:
    """Print a line to stderr."""
    print(line, file=sys.stderr, flush=True)  # noqa: T201


def table(rows: Iterable[BenchmarkRow]) -> str:
    """The rows as aligned text; failed bounds are marked."""
    cells = [("", "measured", "", "bound", "")]
    for row in rows:
        bound = "" if row.bound is None else f"{'>=' if row.at_least else '<='} {row.bound:g}"
        cells.append((row.name, f"{row.value:.4g}", row.unit, bound, "" if row.holds else "VIOLATED"))
    widths = [max(len(line[i]) for line in cells) for i in range(5)]
    return "\n".join(
        "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in cells
    )


def main(arguments: Sequence[str]) -> int:
    """Measure, print each benchmark as it ends, and at last the broken bounds.

    The exit code is 1 if a benchmark or a bound fails, or a bound belongs to no row.
    """
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.harness")
    parser.add_argument("names", nargs="*", metavar="NAME", help="of a benchmark: absent, all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    given = parser.parse_args(arguments)
    bounds = read_bounds(HERE / "bounds.yaml")
    violated: list[BenchmarkRow] = []
    found: dict[str, set[str]] = {}
    failed: list[str] = []
    for benchmark, measured in measure(given.names, given.jobs):
        if measured.failure:
            say(measured.failure)
            failed.append(benchmark)
        rows = [bounded(row, bounds.get(benchmark, {}), measured.slower) for row in measured.rows]
        print(table(rows) if rows else f"{benchmark}: no rows", end="\n\n", flush=True)  # noqa: T201
        violated += [row for row in rows if not row.holds]
        found[benchmark] = {row.name for row in rows}
    lost = without_row(bounds, found)
    for bound in lost:
        say(f"bounds.yaml: {bound}: no such row was measured; was it renamed?")
    for benchmark in failed:
        say(f"{benchmark}: failed")
    count = sum(map(len, found.values()))
    print(table(violated) if violated else f"all bounds of {count} rows hold")  # noqa: T201
    return 1 if lost or violated or failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
