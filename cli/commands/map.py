"""gridslam map"""

from __future__ import annotations

from .. import console
from ..options import (
    AsJson,
    ConfigName,
    Continue,
    Drawing,
    EndTime,
    Force,
    Inputs,
    Jobs,
    LogPaths,
    Output,
    Overrides,
    RunTruth,
    Seed,
    StartTime,
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
    start: StartTime = None,
    end: EndTime = None,
    override: Overrides = None,
    seed: Seed = None,
    jobs: Jobs = None,
    force: Force = False,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Build a map and a trajectory from a log, or one map from several logs in the order of the drives."""
    from gridslam.logs.find import find_logs

    from ..running import RunOptions, given, run_command, span_overrides

    found = [log for path in logs for log in find_logs(path)]
    if len(found) > len(logs):
        console.say(f"one map from {len(found)} logs, in this order: {', '.join(map(str, found))}")
    options = RunOptions(
        log=found[-1],
        earlier=tuple(found[:-1]),
        config=config,
        output=output,
        overrides=(*(override or ()), *span_overrides(start, end)),
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
