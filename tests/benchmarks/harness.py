"""Benchmarks: every `bench_*.py` beside this file gives rows, `bounds.yaml` says what they may not exceed.

Run with `make bench`, or `python -m tests.benchmarks.harness [NAME ...]` for single files. A file exposes
`rows() -> Iterable[Row]`; a benchmark whose data is not there gives no rows and says so on stderr.
"""

from __future__ import annotations

import importlib
import math
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import yaml

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True, slots=True)
class Row:
    """One measured figure; `bound` is the largest value allowed, or the least where `at_least`."""

    name: str
    value: float
    unit: str
    bound: float | None = None
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether the bound is kept; a figure that is no number keeps none."""
        if math.isnan(self.value):
            return False
        if self.bound is None:
            return True
        return self.value >= self.bound if self.at_least else self.value <= self.bound


def read_bounds(path: Path) -> dict[str, dict[str, float]]:
    """`name: {at_most: x}` or `name: {at_least: x}`."""
    document = yaml.safe_load(path.read_text()) or {}
    for name, bound in document.items():
        if not isinstance(bound, dict) or len(bound) != 1 or not {"at_most", "at_least"} >= set(bound):
            raise ValueError(
                f"{path}: {name}: expected {{at_most: NUMBER}} or {{at_least: NUMBER}}, got {bound!r}"
            )
    return document


def bounded(row: Row, bounds: dict[str, dict[str, float]]) -> Row:
    """The row with the bound that the file sets, which wins over the row's own."""
    if row.name not in bounds:
        return row
    ((kind, value),) = bounds[row.name].items()
    return replace(row, bound=float(value), at_least=kind == "at_least")


def measure(names: Sequence[str]) -> Iterator[Row]:
    """The rows of the named files, in order; of all files without names."""
    files = sorted(path.stem for path in HERE.glob("bench_*.py"))
    chosen = [f"bench_{name.removeprefix('bench_')}" for name in names] or files
    for file in chosen:
        if file not in files:
            raise SystemExit(f"no benchmark {file!r}; there are: {', '.join(files)}")
        started = time.perf_counter()
        yield from importlib.import_module(f"tests.benchmarks.{file}").rows()
        say(f"{file}: {time.perf_counter() - started:.1f} s")


def say(line: str) -> None:
    """A remark, on stderr."""
    print(line, file=sys.stderr, flush=True)  # noqa: T201


def table(rows: Iterable[Row]) -> str:
    """The rows as aligned text; a broken bound is marked."""
    cells = [("", "measured", "", "bound", "")]
    for row in rows:
        bound = "" if row.bound is None else f"{'>=' if row.at_least else '<='} {row.bound:g}"
        cells.append((row.name, f"{row.value:.4g}", row.unit, bound, "" if row.holds else "BROKEN"))
    widths = [max(len(line[i]) for line in cells) for i in range(5)]
    return "\n".join(
        "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in cells
    )


def main(arguments: Sequence[str]) -> int:
    """Measure, print, and say by the exit code whether all bounds hold."""
    bounds = read_bounds(HERE / "bounds.yaml")
    rows = [bounded(row, bounds) for row in measure(arguments)]
    print(table(rows))  # noqa: T201
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
