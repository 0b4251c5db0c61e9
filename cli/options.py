"""Options that several commands share."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from gridslam.methods.registry import MethodEntry, built_in_with

from . import console


def methods_with(has: Callable[[MethodEntry], object]) -> str:
    """Names of methods for a text of help."""
    return ", ".join(built_in_with(has))


# Inputs are declared readable=False: what cannot be read is then told, with its exit code, by what reads it.
LogPath = Annotated[
    Path,
    typer.Argument(
        metavar="LOG", readable=False, help="A log: MCAP, CSV folder, CARMEN, rosbag2 or ROS 1 bag."
    ),
]
ConfigName = Annotated[
    str,
    typer.Option(
        "--config", "-c", metavar="CONFIG", help="A YAML file, or a built-in config such as slam-sd."
    ),
]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="The run directory to write.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the run directory that is there.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Override a key, for example method.particles=50. Repeatable."
    ),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the run; wins over the config.")]
Jobs = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Threads to use. The result does not depend on it.")
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Exit with 3 when anything in the log could not be used.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]

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

Inputs = Annotated[
    list[str] | None,
    typer.Option("--input", metavar="NAME=FILE", help="A further input of a method of another package."),
]

_Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress and no remarks on stderr; errors only.")
]
_Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def common(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options that all commands have: --quiet and --debug."""

    @functools.wraps(command)
    def with_common(*args: Any, quiet: bool, debug: bool, **kwargs: Any) -> None:
        console.settings.quiet |= quiet
        console.settings.debug |= debug
        try:
            command(*args, **kwargs)
        except KeyboardInterrupt:  # typer's own answer to it differs between its releases
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
