"""The tables of a sweep; their bytes do not depend on the order in which runs finished."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from gridslam.core.files import write_atomic
from gridslam.report.document import json_bytes, plain
from gridslam.sweep.job_result import RunRow
from gridslam.sweep.summary import NUMBERS, RATES, Group

GROUP_COLUMNS = ("log", "config", "override")
COSTS = ("wall_s", "cpu_s", "peak_mb", "read_s", "process_s")


def write_tables(
    folder: Path, rows: Sequence[RunRow], document: dict[str, Any], groups: Sequence[Group]
) -> None:
    """Write runs.csv and runs.json (a row per run), summary.csv and summary.json, and costs.csv (times and memory)."""
    _write_csv(folder / "runs.csv", *run_table(rows))
    write_atomic(folder / "runs.json", json_bytes({"runs": [_run_document(row) for row in rows]}))
    _write_csv(folder / "summary.csv", *summary_table(groups))
    write_atomic(folder / "summary.json", json_bytes(document))
    costs = [[*_group_of(row), row.seed, *(row.result.cost.get(name) for name in COSTS)] for row in rows]
    _write_csv(folder / "costs.csv", (*GROUP_COLUMNS, "seed", *COSTS), costs)


def run_table(rows: Sequence[RunRow]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows: log, config, override, seed, state, error, and all measures of any run."""
    keys = list(dict.fromkeys(key for row in rows for key in row.measures))
    lines: list[list[object]] = [
        [*_group_of(row), row.seed, row.result.state, row.result.error, *(row.measures.get(k) for k in keys)]
        for row in rows
    ]
    return [*GROUP_COLUMNS, "seed", "state", "error", *keys], lines


def summary_table(groups: Iterable[Group]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows: one row per measure and group."""
    lines: list[list[object]] = [
        [
            group.log, group.config, group.override, key, measure.n, measure.missing,
            *(measure.statistic(name) for name in (*NUMBERS, *RATES)),
        ]
        for group in groups
        for key, measure in group.measures.items()
    ]  # fmt: skip
    return [*GROUP_COLUMNS, "key", "n", "missing", *NUMBERS, *RATES], lines


def summary_document(groups: Iterable[Group]) -> list[dict[str, Any]]:
    """The groups as JSON values; None for a statistic without a value."""
    return [
        {
            **dict(zip(GROUP_COLUMNS, (group.log, group.config, group.override), strict=True)),
            "runs": group.runs,
            "done": group.done,
            "measures": {
                key: {"n": measure.n, "missing": measure.missing, **plain(measure.values)}
                for key, measure in group.measures.items()
            },
        }
        for group in groups
    ]


def _run_document(row: RunRow) -> dict[str, Any]:
    result = row.result
    group = dict(zip(GROUP_COLUMNS, _group_of(row), strict=True))
    return {
        **group,
        "seed": row.seed,
        "state": result.state,
        "error": result.error,
        "measures": dict(row.measures),
    }


def _group_of(row: RunRow) -> tuple[str, str, str]:
    return row.log, row.config, row.override


def _write_csv(path: Path, columns: Sequence[str], lines: Iterable[Sequence[object]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(value) for value in line] for line in lines)
    write_atomic(path, text.getvalue().encode(errors="backslashreplace"))


def _cell(value: object) -> str:
    """The text of a cell: floats in the shortest form that reads back exactly; empty for None, NaN and infinities."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)
