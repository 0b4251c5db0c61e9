"""gridslam map"""

from __future__ import annotations

from ..options import (
    AsJson,
    ConfigName,
    Drawing,
    Force,
    Inputs,
    Jobs,
    LogPath,
    Output,
    Overrides,
    Seed,
    Strict,
    Tags,
)


def run(
    log: LogPath,
    config: ConfigName,
    output: Output,
    drawing: Drawing = None,
    tags: Tags = None,
    further: Inputs = None,
    override: Overrides = None,
    seed: Seed = None,
    jobs: Jobs = None,
    force: Force = False,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Build a map and a trajectory from a log."""
    from ..running import RunOptions, given, run_command

    inputs = given(further, drawing=drawing, tags=tags)
    overrides = tuple(override or ())
    run_command("map", RunOptions(log, config, output, overrides, seed, jobs, force, strict, as_json, inputs))
