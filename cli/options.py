"""Options of several commands."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gridslam.core.stamps import END_S
from gridslam.methods.registry import MethodEntry, built_in_with

from . import console
from .completion import complete_config

if TYPE_CHECKING:
    from gridslam.logs.config import LogConfig


def methods_with(has: Callable[[MethodEntry], object]) -> str:
    """Names of the matching methods, for help texts."""
    return ", ".join(built_in_with(has))


# Inputs are declared readable=False, so that their reader reports an unreadable file with its own exit code.
LogPath = Annotated[
    Path,
    typer.Argument(
        metavar="LOG", readable=False, help="A log: MCAP, CSV folder, CARMEN, rosbag2 or ROS 1 bag."
    ),
]
LogPaths = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...",
        readable=False,
        help="A log: MCAP, CSV folder, CARMEN, rosbag2 or ROS 1 bag. Several logs, a pattern such as 'logs/*.mcap', or a "
        "folder of logs become one map.",
    ),
]
ConfigName = Annotated[
    str,
    typer.Option(
        "--config",
        "-c",
        metavar="CONFIG",
        autocompletion=complete_config,
        help="A YAML file, or a built-in config such as slam-sd.",
    ),
]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="The run directory to write.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing run directory.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Override a key, for example method.particles=50. Repeatable."
    ),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the run; overrides the config's.")]
Jobs = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Number of threads. The result does not depend on it.")
]
StartTime = Annotated[
    float | None,
    typer.Option(
        "--start", metavar="S", min=0.0, max=END_S, help="Use the log from S seconds after its start."
    ),
]
EndTime = Annotated[
    float | None,
    typer.Option(
        "--end", metavar="S", min=0.0, max=END_S, help="Use the log up to S seconds after its start."
    ),
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Exit with 3 if the log could not be used as recorded (messages lost or repaired, something assumed), "
        "with 5 if the result is lost, inconsistent or apart.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]

RunTruth = Annotated[
    Path | None,
    typer.Option(
        "--truth",
        metavar="PATH",
        readable=False,
        help="True poses for the error in the report: a trajectory, a log, or a folder NAME.truth. "
        "Default: those in or beside the log.",
    ),
]
TruthTopic = Annotated[
    str | None,
    typer.Option(
        "--truth-topic",
        metavar="TOPIC",
        help="Topic of the true poses in the log that --truth names, or two tf frames: 'map->base_link'.",
    ),
]

Drawing = Annotated[
    Path | None,
    typer.Option(
        "--drawing",
        metavar="PNG",
        readable=False,
        help=f"A hand-drawn map of the place ({methods_with(lambda entry: 'drawing' in entry.input_names)}).",
    ),
]
Tags = Annotated[
    Path | None,
    typer.Option(
        "--tags",
        metavar="TAGS.yaml",
        readable=False,
        help=f"What the RFID tags are fixed to ({methods_with(lambda entry: 'tags' in entry.input_names)}).",
    ),
]
Continue = Annotated[
    Path | None,
    typer.Option(
        "--continue",
        metavar="RUN",
        readable=False,
        help="A run directory or its session.npz: the log continues its map "
        f"({methods_with(lambda entry: entry.is_continued)}).",
    ),
]

Inputs = Annotated[
    list[str] | None,
    typer.Option("--input", metavar="NAME=FILE", help="A further input of a method of another package."),
]


def reading_config(
    config: str | None, layout: Path | None, start_s: float | None = None, end_s: float | None = None
) -> LogConfig:
    """Reading settings of `info` and `convert`: the `log` section of a config, changed by the other arguments.

    Raises ConfigError: the span ends before it starts.
    """
    from gridslam.core.errors import ConfigError
    from gridslam.logs.config import LogConfig

    settings = LogConfig()
    if config is not None:
        from gridslam.runs.run_config import load_config

        settings = load_config(config, ()).log
    given = {"csv": layout, "start_s": start_s, "end_s": end_s}
    settings = settings.model_copy(update={key: value for key, value in given.items() if value is not None})
    if settings.start_s is not None and settings.end_s is not None and settings.start_s > settings.end_s:
        raise ConfigError(
            f"--start {settings.start_s:g} --end {settings.end_s:g}: the end lies before the start"
        )
    return settings


def check_output_file(path: Path, force: bool, inputs: Iterable[Path]) -> None:
    """Raises ConfigError unless a file may be written: a new path, or with `force` one that is none of the `inputs`."""
    from gridslam.core.files import check_file_free, refuse_to_replace

    check_file_free(path, force)
    refuse_to_replace(path, inputs)


_Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors to stderr.")]
_Debug = Annotated[bool, typer.Option("--debug", help="Print the traceback of an error.")]


def common(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options --quiet and --debug to a command."""

    @functools.wraps(command)
    def with_common(*args: Any, quiet: bool, debug: bool, **kwargs: Any) -> None:
        console.settings.quiet |= quiet
        console.settings.debug |= debug
        try:
            command(*args, **kwargs)
        except KeyboardInterrupt:  # typer handles it differently between releases
            raise typer.Abort from None
        except EOFError as error:  # typer would take it for an interruption
            raise RuntimeError("a file or stream ended early") from error

    added = {"quiet": _Quiet, "debug": _Debug}
    signature = inspect.signature(command, eval_str=True)
    parameters = [
        *signature.parameters.values(),
        *(
            inspect.Parameter(n, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=a)
            for n, a in added.items()
        ),
    ]
    with_common.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_common.__annotations__ = {p.name: p.annotation for p in parameters}
    return with_common
