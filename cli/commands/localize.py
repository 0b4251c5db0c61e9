"""gridslam localize"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import (
    AsJson,
    ConfigName,
    EndTime,
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
        help="The map: a map_server YAML, wean.dat(.gz), or a run with its session. "
        "Not needed by methods with absolute poses as input: "
        f"{methods_with(lambda entry: entry.localizes_without_map)}.",
    ),
]
Start = Annotated[
    list[str] | None,
    typer.Option(
        "--start",
        metavar="X,Y,YAW|S",
        help="Start pose (m, m, rad; default: unknown), or use the log from S seconds after its start. Repeatable.",
    ),
]


def run(
    log: LogPath,
    config: ConfigName,
    output: Output,
    map_path: MapPath = None,
    start: Start = None,
    end: EndTime = None,
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
    from ..running import RunOptions, given, run_command, span_overrides, start_override

    poses = [text for text in start or () if "," in text]
    times = [seconds_of(text) for text in start or () if "," not in text]

    options = RunOptions(
        log=log,
        config=config,
        output=output,
        overrides=(
            *(override or ()),
            *map(start_override, poses),
            *span_overrides(times[-1] if times else None, end),
        ),
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


def seconds_of(text: str) -> float:
    """The seconds of `--start S`. Raises ConfigError: neither a number nor a pose."""
    from gridslam.core.errors import ConfigError

    try:
        return float(text)
    except ValueError:
        raise ConfigError(
            f"--start {text}: expected a pose x,y,yaw in metres and radians, for example --start 1.5,-2,0.3, "
            "or a number of seconds"
        ) from None
