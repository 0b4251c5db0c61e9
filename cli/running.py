"""What `map` and `localize` have in common: options, the run, its directory, the result on stdout."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from gridslam.core.errors import ConfigError
from gridslam.report.directory import check_free
from gridslam.report.write import write_run
from gridslam.run import Command, Run, run_localize, run_map
from gridslam.run_config import load_run_config

from . import console
from .interruption import stop_on_signals

LOSSY, INTERRUPTED = 3, 130
MOST_PROBLEMS = 10


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The command line of a run."""

    log: Path
    config: str
    output: Path
    overrides: tuple[str, ...]
    seed: int | None
    jobs: int | None
    force: bool
    strict: bool
    as_json: bool


def run_command(command: Command, options: RunOptions, map_path: Path | None = None) -> None:
    """Run, write, print. Exits with 130 when interrupted, with 3 when the log was lossy under --strict."""
    check_free(options.output, options.force)
    config = load_run_config(options.config, options.overrides, options.seed)
    if options.jobs is not None:
        os.environ["NUMBA_NUM_THREADS"] = str(options.jobs)  # read when numba is imported, which is later
    from gridslam.kernels.compiling import (
        telling_of_compilation,
    )  # imports numba: not before the checks above

    with (
        stop_on_signals() as stop,
        console.progress_bar(command) as show,
        telling_of_compilation(
            lambda: console.say("compiling kernels, once per installation; this takes a while")
        ),
    ):
        if map_path is None:
            run = run_map(config, options.log, show, stop)
        else:
            run = run_localize(config, options.log, map_path, show, stop)
    for problem in run.problems[:MOST_PROBLEMS]:
        console.say(f"{options.log}: {problem}")
    if len(run.problems) > MOST_PROBLEMS:
        console.say(f"{options.log}: and {len(run.problems) - MOST_PROBLEMS} more, see report.json")
    document = write_run(run, options.output, options.force)
    if options.as_json:
        console.emit_json(document)
    else:
        console.emit_table(("", ""), summary(run, document, options.output))
    if run.status == "interrupted":
        console.complain(f"interrupted: {options.output} holds the run up to there")
        raise typer.Exit(INTERRUPTED)
    if run.is_lossy and options.strict:
        console.complain(
            f"error: {options.log}: not all of the log could be used, which --strict forbids; see report.json"
        )
        raise typer.Exit(LOSSY)


def summary(run: Run, document: dict[str, Any], output: Path) -> list[tuple[str, str]]:
    """What a person wants to know after a run."""
    path, timing = document["trajectory"], document["timing"]
    rows = [
        ("status", run.status),
        ("trajectory", f"{path['poses']} poses, {path['length_m']:.1f} m"),
    ]
    if (facts := document["map"]) is not None:
        cells = f"{facts['cols']} x {facts['rows']} cells of {facts['resolution_m'] * 100:g} cm"
        rows.append(("map", f"{cells}, {facts['known_m2']:.0f} m2 known"))
    rows.append(("time", f"{timing['total_s']:.1f} s, {document['memory']['peak_mb']:.0f} MB"))
    if run.occupancy is not None:
        rows.append(("picture", str(output / "map.png")))
    rows.append(("report", str(output / ("report.html" if run.config.output.html else "report.json"))))
    return rows


def start_override(text: str) -> str:
    """`--start x,y,yaw` as the override that it stands for."""
    try:
        x, y, yaw = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            f"--start {text}: expected x,y,yaw in metres and radians, for example --start 1.5,-2,0.3"
        ) from None
    return f"method.start=[{x!r}, {y!r}, {yaw!r}]"
