"""gridslam localize"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import (
    AsJson,
    ConfigName,
    Force,
    Inputs,
    Jobs,
    LogPath,
    Output,
    Overrides,
    RunTruth,
    Seed,
    Strict,
    TruthTopic,
    methods_with,
)

MapPath = Annotated[
    Path | None,
    typer.Option(
        "--map",
        metavar="MAP",
        readable=False,
        help="The map: a map_server YAML, or wean.dat(.gz). Not needed by methods with absolute poses as input: "
        f"{methods_with(lambda entry: entry.localizes_without_map)}.",
    ),
]
Start = Annotated[
    str | None,
    typer.Option("--start", metavar="X,Y,YAW", help="Start pose (m, m, rad). Default: unknown."),
]


def run(
    log: LogPath,
    config: ConfigName,
    output: Output,
    map_path: MapPath = None,
    start: Start = None,
    further: Inputs = None,
    truth: RunTruth = None,
    truth_topic: TruthTopic = None,
    override: Overrides = None,
    seed: Seed = None,
    jobs: Jobs = None,
    force: Force = False,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Localize the robot along a log on a given map."""
    from ..running import RunOptions, given, run_command, start_override

    options = RunOptions(
        log=log,
        config=config,
        output=output,
        overrides=(*(override or ()), *([start_override(start)] if start else [])),
        seed=seed,
        jobs=jobs,
        force=force,
        strict=strict,
        as_json=as_json,
        inputs=given(further),
        truth=truth,
        truth_topic=truth_topic,
    )
    run_command("localize", options, map_path)
