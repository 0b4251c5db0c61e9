"""gridslam sweep"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from .. import console
from ..options import AsJson

if TYPE_CHECKING:
    from gridslam.sweep.summary import Group, Measure
    from gridslam.sweep.sweep import SweepResult

FAILED_GATE, FAILED_RUNS, INTERRUPTED = 1, 4, 130
MAX_LISTED = 10
COMMON_MEASURES = (
    "ape.trans.rmse", "ape.rot.rmse", "relations.trans.mean", "relations.rot.mean", "final.trans",
    "localization.success", "localization.time_to_convergence", "map.accuracy.mean", "map.iou",
)  # fmt: skip

SweepFile = Annotated[
    Path,
    typer.Argument(
        metavar="SWEEP.yaml", readable=False, help="The sweep file: what to run and how to evaluate it."
    ),
]
SweepOutput = Annotated[
    Path,
    typer.Option(
        "--output", "-o", metavar="DIR", help="Directory of runs and tables; finished runs in it are kept."
    ),
]
Processes = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Number of processes. Default: one per core.")
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="A running Dask scheduler, such as tcp://host:8786."),
]
Require = Annotated[
    list[str] | None,
    typer.Option(
        "--require", metavar="GATE", help="A further gate, as in `require` of the file. Repeatable."
    ),
]


def run(
    path: SweepFile,
    output: SweepOutput,
    jobs: Processes = None,
    scheduler: Scheduler = None,
    require: Require = None,
    as_json: AsJson = False,
) -> None:
    """Run and evaluate logs x configs x overrides x seeds, and write tables of the results."""
    from gridslam.core.errors import ConfigError
    from gridslam.core.files import real_path
    from gridslam.sweep.cluster import run_on_cluster
    from gridslam.sweep.config import load_sweep
    from gridslam.sweep.gates import parse_sweep_gate
    from gridslam.sweep.local import run_locally
    from gridslam.sweep.sweep import run_sweep

    from ..interruption import finishing, stop_on_signals

    if jobs is not None and scheduler is not None:
        raise ConfigError(
            "--jobs and --scheduler: use only one of them: a cluster has its own number of workers"
        )
    sweep = load_sweep(path)
    gates = [parse_sweep_gate(text) for text in require or ()]
    folder = real_path(path).parent
    try:
        with stop_on_signals("stopping; finished runs are kept") as stop:
            if scheduler is None:
                work = partial(run_locally, processes=jobs or os.cpu_count() or 1, stop=stop)
            else:
                work = partial(run_on_cluster, address=scheduler, stop=stop)
            result = run_sweep(
                sweep, folder, output=output, run=work, report=console.say, stop=stop, gates=gates
            )
    except KeyboardInterrupt:
        if not output.exists():
            raise
        _exit_interrupted(output)
    with finishing():
        if as_json:
            console.emit_json(result.document)
        else:
            _show(result.groups, sweep.show)
    _exit_unless_complete(result, output)


def _show(groups: Sequence[Group], wanted: Sequence[str]) -> None:
    """Print a row per group: means with their intervals, rates in percent."""
    found = list(dict.fromkeys(key for group in groups for key in group.measures))
    keys = list(wanted) or [key for key in found if key in COMMON_MEASURES or key.startswith("success.")]
    rows = [
        [group.log, group.config, group.override, f"{group.done}/{group.runs}"]
        + [_text(group.measures.get(key)) for key in keys]
        for group in groups
    ]
    console.emit_table(("log", "config", "override", "runs", *keys), rows)


def _text(measure: Measure | None) -> str:
    if measure is None or not measure.n:
        return "-"
    values = measure.values
    if "rate" in values:
        return f"{values['rate']:.0%} ({values['rate_low']:.0%} to {values['rate_high']:.0%})"
    if measure.n == 1:
        return f"{values['mean']:.4g}"
    return f"{values['mean']:.4g} +- {values['mean_high'] - values['mean']:.2g}"


def _exit_interrupted(output: Path) -> NoReturn:
    console.complain(f"interrupted: {output} has the finished runs; the same command continues the sweep")
    raise typer.Exit(INTERRUPTED)


def _exit_unless_complete(result: SweepResult, output: Path) -> None:
    """Exit with 130 if interrupted, 4 if runs failed, 1 if gates failed; print them to stderr."""
    for row in result.failed[:MAX_LISTED]:
        console.complain(f"error: {row.label}: {row.result.error}")
    for line in result.failed_gates[:MAX_LISTED]:
        console.complain(f"error: {line}")
    for what, count in (("runs", len(result.failed)), ("gates", len(result.failed_gates))):
        if count > MAX_LISTED:
            console.complain(f"error: {count} {what} failed; {output / 'summary.json'} lists all")
    if result.is_interrupted:
        _exit_interrupted(output)
    if result.failed:
        raise typer.Exit(FAILED_RUNS)
    if result.failed_gates:
        raise typer.Exit(FAILED_GATE)
