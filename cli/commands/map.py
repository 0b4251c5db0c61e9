"""gridslam map"""

from __future__ import annotations

from ..options import AsJson, ConfigName, Force, Jobs, LogPath, Output, Overrides, Seed, Strict


def run(
    log: LogPath,
    config: ConfigName,
    output: Output,
    override: Overrides = None,
    seed: Seed = None,
    jobs: Jobs = None,
    force: Force = False,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Make a map and a trajectory from a log."""
    from ..running import RunOptions, run_command

    run_command(
        "map", RunOptions(log, config, output, tuple(override or ()), seed, jobs, force, strict, as_json)
    )
