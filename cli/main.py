"""The application and its error boundary."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

import gridslam
from gridslam.core.errors import GridslamError, was_interrupted
from gridslam.core.threads import drop_wrong_counts

from . import INTERRUPTED, console
from . import run as run  # kept here for existing programs
from .commands import (
    config,
    convert,
    correlation,
    drawing,
    evaluate,
    explore,
    info,
    localize,
    maps,
    plan,
    simulate,
    sweep,
    warmup,
)
from .commands import map as map_command
from .options import common

BUG, USAGE, METHOD = 70, 2, 4
NOTHING_WRITTEN = "interrupted; nothing was written"

# Typer bundles a copy of click: this is the base of all its usage errors.
UsageProblem: type[Exception] = typer.BadParameter.__mro__[2]

app = typer.Typer(
    invoke_without_command=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("map")(common(map_command.run))
app.command("localize")(common(localize.run))
app.command("evaluate")(common(evaluate.run))
app.command("plan")(common(plan.run))
app.command("correlation")(common(correlation.run))
app.command("simulate")(common(simulate.run))
app.command("explore")(common(explore.run))
app.command("sweep")(common(sweep.run))
app.command("info")(common(info.run))
app.command("convert")(common(convert.run))
app.add_typer(config.app, name="config")
app.add_typer(maps.app, name="maps")
app.add_typer(drawing.app, name="drawing")
app.command("warmup")(common(warmup.run))


def _show_version(wanted: bool) -> None:
    if wanted:
        console.emit(f"gridslam {gridslam.__version__}")
        raise typer.Exit


@app.callback()
def main_options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Occupancy mapping, SLAM and localization from recorded sensor logs."""
    if context.invoked_subcommand is None:
        console.emit(context.get_help())
        raise typer.Exit(USAGE)


def main(arguments: Sequence[str]) -> int:
    """Run one command line and return the exit code. An error is printed as one line on stderr.

    0 done, 1 a gate failed, 2 usage or config, 3 input, 4 the method failed, 70 a bug, 130 interrupted.
    """
    console.settings.quiet = False
    console.settings.debug = "--debug" in arguments
    console.settings.has_spoken = False
    console.start()
    for variable in drop_wrong_counts():
        console.say(f"warning: {variable} is not a number of threads, and is ignored")
    try:
        code = app(args=list(arguments), prog_name="gridslam", standalone_mode=False)
        if code == INTERRUPTED and not console.settings.has_spoken:  # raised by typer while parsing
            raise KeyboardInterrupt
        return code if isinstance(code, int) else 0
    except GridslamError as error:
        return _fail(str(error), error.exit_code)
    except UsageProblem as error:
        return _fail(_usage_message(error), USAGE)
    except (KeyboardInterrupt, typer.Abort):
        return _fail(NOTHING_WRITTEN, INTERRUPTED)
    except MemoryError:
        return _fail("out of memory: use coarser cells, fewer particles or a shorter log", METHOD)
    except BrokenPipeError:
        console.silence_stdout()
        return 0
    except OSError as error:  # a full disk, a missing permission
        return _fail(f"{error.filename or 'output'}: {error.strerror or error}", USAGE)
    except Exception as error:
        if was_interrupted(error):
            return _fail(NOTHING_WRITTEN, INTERRUPTED)
        return _fail(f"internal error, please report it with the command: {_place_of(error)}", BUG)


def _fail(message: str, code: int) -> int:
    if console.settings.debug:
        for line in traceback.format_exc().splitlines():
            console.complain(line)
    console.complain(f"error: {' '.join(message.split())}")
    return code


def _usage_message(error: Exception) -> str:
    """The usage error with the name of the option, and the command that prints help."""
    format_message = getattr(error, "format_message", None)
    command = getattr(getattr(error, "ctx", None), "command_path", "gridslam")
    return f"{format_message() if format_message else error} ({command} --help explains)"


def _place_of(error: Exception) -> str:
    """The error with the innermost source line."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    version = gridslam.__version__
    return f"{type(error).__name__}: {error}{place} (gridslam {version}, --debug shows the traceback)"
