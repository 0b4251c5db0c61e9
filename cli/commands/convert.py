"""gridslam convert"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import console
from ..completion import complete_config
from ..options import AsJson, EndTime, LogPath, StartTime, Strict, reading_config
from .info import LOSSY, MAX_ROWS, Layout

MAX_PROBLEMS = 20
Destination = Annotated[
    Path | None,
    typer.Argument(metavar="OUT", help="What to write: MCAP if the name ends in .mcap, else a CSV folder."),
]
Rosbag2Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Write a rosbag2 folder instead of OUT."),
]
ReadingConfig = Annotated[
    str | None,
    typer.Option(
        "--config",
        "-c",
        metavar="CONFIG",
        autocompletion=complete_config,
        help="Read the log by the `log` section of this config.",
    ),
]
Topics = Annotated[
    str, typer.Option("--topics", metavar="A,B", help="Only these topics (see gridslam info).")
]
Replace = Annotated[bool, typer.Option("--force", help="Replace what is there.")]


def run(
    log: LogPath,
    output: Destination = None,
    rosbag2: Rosbag2Output = None,
    config: ReadingConfig = None,
    topics: Topics = "",
    start: StartTime = None,
    end: EndTime = None,
    layout: Layout = None,
    force: Replace = False,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Rewrite any log as MCAP, as a folder of CSV files, or as a rosbag2 folder (-o)."""
    from gridslam.core.errors import ConfigError
    from gridslam.logs.convert import convert_log
    from gridslam.logs.open import open_log

    from ..interruption import finishing

    if (output is None) == (rosbag2 is None):
        raise ConfigError("name either OUT or -o DIR")
    target = output or rosbag2
    assert target is not None
    with open_log(log, reading_config(config, layout)) as opened:
        chosen = [topic for topic in topics.split(",") if topic]
        done = convert_log(
            opened,
            target,
            topics=chosen,
            start_s=start,
            end_s=end,
            force=force,
            as_rosbag2=rosbag2 is not None,
        )
        problems, is_lossy, counters = opened.problems, opened.is_lossy, opened.counters
    with finishing():
        for problem in problems[:MAX_PROBLEMS]:
            console.say(f"note: {problem}")
        if done.left_out and not chosen:
            console.say(f"note: not converted, no method uses such messages: {', '.join(done.left_out)}")
        if as_json:
            document = {
                "output": str(target),
                "written": done.written,
                "counters": counters,
                "problems": problems,
            }
            console.emit_json({**document, "is_lossy": is_lossy})
        else:
            console.emit_table(("topic", "messages"), list(done.written.items())[:MAX_ROWS])
            if len(done.written) > MAX_ROWS:
                console.emit(f"and {len(done.written) - MAX_ROWS} more; --json shows all")
    if strict and is_lossy:
        console.complain(
            f"error: {log}: not all of the log could be used, which --strict forbids; {target} has the rest"
        )
        raise typer.Exit(LOSSY)
