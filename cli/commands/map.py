"""gridslam map"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import AsJson, ConfigName, Force, Jobs, Output, Overrides, Seed, Strict

LogPath = Annotated[
    Path, typer.Argument(metavar="LOG", help="A log: MCAP, CSV folder, CARMEN, rosbag2 or ROS 1 bag.")
]


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
