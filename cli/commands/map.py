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
    RunTruth,
    Seed,
    Strict,
    Tags,
    TruthTopic,
)


def run(
    log: LogPath,
    config: ConfigName,
    output: Output,
    drawing: Drawing = None,
    tags: Tags = None,
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
    """Build a map and a trajectory from a log."""
    from ..running import RunOptions, given, run_command

    options = RunOptions(
        log=log,
        config=config,
        output=output,
        overrides=tuple(override or ()),
        seed=seed,
        jobs=jobs,
        force=force,
        strict=strict,
        as_json=as_json,
        inputs=given(further, drawing=drawing, tags=tags),
        truth=truth,
        truth_topic=truth_topic,
    )
    run_command("map", options)
