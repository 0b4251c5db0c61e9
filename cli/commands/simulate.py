"""gridslam simulate"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import console
from ..completion import complete_world
from ..options import AsJson, check_output_file

if TYPE_CHECKING:
    from gridslam.simulation.record import Recorded
    from gridslam.simulation.world_config import WorldConfig

STEPS = 1000  # number of steps of the progress bar
WorldName = Annotated[
    str,
    typer.Argument(
        metavar="WORLD",
        autocompletion=complete_world,
        help="A world file (YAML), or a built-in world such as office.",
    ),
]
WorldOverrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the world, for example robot.speed_mps=0.3. Repeatable.",
    ),
]
LogOutput = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="LOG",
        help="The log to write: MCAP if the name ends in .mcap, else a CSV folder.",
    ),
]
Preview = Annotated[
    Path | None,
    typer.Option("--preview", metavar="PNG", help="Draw the world to a picture, with or without -o."),
]
WorldSeed = Annotated[
    int | None, typer.Option("--seed", min=0, help="Seed of all noise; overrides the file's.")
]
Replace = Annotated[bool, typer.Option("--force", help="Replace an existing log and picture.")]


def run(
    world: WorldName,
    output: LogOutput = None,
    preview: Preview = None,
    override: WorldOverrides = None,
    seed: WorldSeed = None,
    force: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a robot in a world; write its log, with the ground truth beside it."""
    from gridslam.simulation.world_config import load_world

    from ..interruption import finishing

    if output is None and preview is None:
        raise typer.BadParameter("nothing to do: add -o LOG or --preview PNG", param_hint="'-o'")
    place, path = load_world(world, override or (), seed)
    if preview is not None:
        check_output_file(preview, force, [path, *_plan_files(place, path.parent)])
    done = None if output is None else _record(place, path.parent, output, force)
    with finishing():
        if preview is not None:
            from gridslam.report.world_picture import draw_world

            draw_world(place, path.parent, preview)
        if as_json:
            console.emit_json(_document(preview, output, done))
        elif done is not None:
            console.say(f"{done.duration_s:.0f} s, {done.distance_m:.0f} m; ground truth in {done.truth}")
            console.emit_table(("message", "count"), list(done.messages.items()))


def _plan_files(world: WorldConfig, folder: Path) -> list[Path]:
    """The files of the world's floor plan, if it has one; its name is relative to the folder of the world file."""
    if world.plan is None:
        return []
    from gridslam.maps.load import map_files

    return map_files(folder / world.plan.file)


def _document(preview: Path | None, output: Path | None, done: Recorded | None) -> dict[str, object]:
    """The JSON document of what was written."""
    document: dict[str, object] = {} if preview is None else {"preview": str(preview)}
    if done is not None:
        document |= {
            "output": str(output),
            "truth": str(done.truth),
            "duration_s": round(done.duration_s, 3),
            "distance_m": round(done.distance_m, 3),
            "messages": done.messages,
        }
    return document


def _record(world: WorldConfig, folder: Path, output: Path, force: bool) -> Recorded:
    """Record the world with a progress bar, and a notice if the ray caster has to be compiled first."""
    from gridslam.kernels.compiling import announcing_compilation
    from gridslam.runs.feed import Progress
    from gridslam.simulation.record import record_world

    from ..interruption import stop_on_signals

    def notify() -> None:
        console.say("compiling the ray caster, once per installation: some seconds")

    with (
        console.progress_bar("simulate") as show,
        announcing_compilation(notify),
        stop_on_signals("stopping; an incomplete log is deleted") as stop,
    ):

        def report(fraction: float) -> None:
            if stop():
                raise KeyboardInterrupt
            show(Progress(round(fraction * STEPS), STEPS, 0))

        return record_world(world, folder, output, force, report)
