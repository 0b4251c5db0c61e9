"""gridslam explore"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gridslam.methods.registry import built_in_with

from .. import console
from ..completion import complete_config
from ..options import AsJson, Force, Inputs, Jobs, Output, Seed
from .simulate import WorldName

if TYPE_CHECKING:
    from gridslam.runs.explore import Explored

FAILED = 4
EXPLORING = built_in_with(lambda entry: entry.explorer)
ExploringConfig = Annotated[
    str,
    typer.Option(
        "--config",
        "-c",
        metavar="CONFIG",
        autocompletion=complete_config,
        help=f"A YAML file or a built-in config of a method that can explore: {', '.join(EXPLORING)}.",
    ),
]
DrawingFile = Annotated[
    Path | None,
    typer.Option("--drawing", metavar="PNG", readable=False, help="A hand-drawn map of the place."),
]
StartInDrawing = Annotated[
    str | None,
    typer.Option(
        "--start-in-drawing",
        metavar="X,Y,YAW",
        help="Where the robot starts in the drawing: metres at 0.1 m a pixel from its lower-left corner, radians. "
        "If absent: method.start of the config, or a search of the whole drawing.",
    ),
]
ExploringOverrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the config, for example method.advanced.exploration.visit_frontiers=false. Repeatable.",
    ),
]
WorldOverrides = Annotated[
    list[str] | None,
    typer.Option("--world", metavar="KEY=VALUE", help="Override a key of the world file. Repeatable."),
]
WorldSeed = Annotated[
    int | None,
    typer.Option("--world-seed", min=0, help="Seed of the world's noise; overrides the world file."),
]
MaxDuration = Annotated[
    float | None,
    typer.Option("--longest", metavar="S", min=1.0, help="Stop after S seconds of simulated time."),
]


def run(
    world: WorldName,
    output: Output,
    drawing: DrawingFile = None,
    config: ExploringConfig = EXPLORING[0],  # the config of the method's own name
    start_in_drawing: StartInDrawing = None,
    further: Inputs = None,
    override: ExploringOverrides = None,
    world_override: WorldOverrides = None,
    seed: Seed = None,
    world_seed: WorldSeed = None,
    longest: MaxDuration = None,
    jobs: Jobs = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Let a simulated robot explore and map a world, guided by a drawing of it."""
    from gridslam.core.files import partial_folder
    from gridslam.core.threads import limit_threads
    from gridslam.report.directory import check_free
    from gridslam.report.write import write_run
    from gridslam.runs.inputs import read_inputs
    from gridslam.runs.run_config import load_config
    from gridslam.simulation.world_config import load_world

    from ..interruption import finishing, stop_on_signals
    from ..running import given, start_override

    files = given(further, drawing=drawing)
    before = check_free(output, force, files.values())
    overrides = [*(override or ())]
    if start_in_drawing is not None:
        overrides.append(start_override(start_in_drawing, "--start-in-drawing"))
    settings = load_config(config, overrides, seed)
    place, path = load_world(world, world_override or (), world_seed)
    if jobs is not None:
        limit_threads(jobs)
    from gridslam.core.files import real_path
    from gridslam.kernels.compiling import announcing_compilation
    from gridslam.runs.explore import LOG_NAME, TRUTH_NAME, explore

    inputs = read_inputs(files, settings.method_name)
    target = real_path(output)
    target.parent.mkdir(parents=True, exist_ok=True)
    with partial_folder(target) as folder, stop_on_signals() as stop:
        with console.progress_bar("explore") as show, announcing_compilation(_say_compiling):
            done = explore(
                settings, place, path, inputs, folder, show=show, stop=stop, max_duration_s=longest
            )
        for problem in done.run.problems:
            console.say(f"{world}: {problem}")
        document = write_run(done.run, output, force, (folder / LOG_NAME, folder / TRUTH_NAME), before)
    with finishing():
        if as_json:
            console.emit_json(document)
        else:
            console.emit_table(("", ""), _summary(done, document, output))
    _exit_unless_finished(done, output)


def _say_compiling() -> None:
    console.say("compiling kernels, once per installation: about a minute")


def _summary(done: Explored, document: dict[str, Any], output: Path) -> list[tuple[str, str]]:
    from ..running import summary

    exploration = document["measures"]["exploration"]
    unreachable = exploration["unreachable"]
    rows = [
        ("exploration", f"{done.ended} after {done.duration_s:.0f} s and {done.travelled_m:.0f} m"),
        (
            "observation points",
            f"{exploration['points']}: {exploration.get('reached', 0)} reached, "
            f"{exploration.get('observed_in_passing', 0)} observed in passing, {len(unreachable)} unreachable",
        ),
        *(("unreachable", f"({p['x']:.1f}, {p['y']:.1f}): {p['reason']}") for p in unreachable),
    ]
    return [*rows, *summary(done.run, document, output)]


def _exit_unless_finished(done: Explored, output: Path) -> None:
    if done.ended == "interrupted":
        console.complain(f"interrupted: {output} holds the run so far")
        raise typer.Exit(130)
    if done.ended != "finished":
        console.complain(f"error: {done.run.problems[0]}; {output} holds the map so far")
        raise typer.Exit(FAILED)
