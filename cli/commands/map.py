"""gridslam map"""

from __future__ import annotations

from ..options import (
    AsJson,
    ConfigName,
    Continue,
    Drawing,
    Force,
    Inputs,
    Jobs,
    LogPaths,
    Output,
    Overrides,
    RunTruth,
    Seed,
    Strict,
    Tags,
    TruthTopic,
)


def run(
    logs: LogPaths,
    config: ConfigName,
    output: Output,
    drawing: Drawing = None,
    tags: Tags = None,
    session: Continue = None,
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
    """Build a map and a trajectory from a log, or one map from several logs in the order of the drives."""
    from ..running import RunOptions, given, run_command

    options = RunOptions(
        log=logs[-1],
        earlier=tuple(logs[:-1]),
        config=config,
        output=output,
        overrides=tuple(override or ()),
        seed=seed,
        jobs=jobs,
        force=force,
        strict=strict,
        as_json=as_json,
        inputs=given(further, drawing=drawing, tags=tags, session=session),
        truth=truth,
        truth_topic=truth_topic,
    )
    run_command("map", options)
