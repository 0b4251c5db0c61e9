"""gridslam plan"""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import console
from ..options import AsJson

if TYPE_CHECKING:
    from gridslam.planning.arcs_and_lines import Plan


class Unknown(str, Enum):
    """What unknown cells are to the robot."""

    blocked = "blocked"
    free = "free"


MapArgument = Annotated[
    Path, typer.Argument(metavar="MAP", readable=False, help="A map: a map_server YAML, or wean.dat(.gz).")
]
Start = Annotated[str, typer.Option("--start", metavar="X,Y,YAW", help="Where the robot is (m, m, rad).")]
Goal = Annotated[
    str, typer.Option("--goal", metavar="X,Y[,YAW]", help="Where it shall be; no yaw: with any heading.")
]
PathOutput = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="DIR", help="Write path.csv, segments.csv, path.png, report.json."
    ),
]
Replace = Annotated[bool, typer.Option("--force", help="Replace the output that is there.")]
Radius = Annotated[
    float | None,
    typer.Option("--radius", metavar="M", help="Radius of a round robot, above 0 (default 0.2)."),
]
Outline = Annotated[
    str | None,
    typer.Option(
        "--footprint", metavar="'X,Y X,Y ...'", help="Corners of a convex robot about its origin instead."
    ),
]
Smallest = Annotated[float, typer.Option("--min-radius", metavar="M", help="Smallest radius of an arc.")]
OnSpot = Annotated[
    bool, typer.Option("--turn-on-spot", help="The robot may turn on the spot; --min-radius 0: anywhere.")
]
Reverse = Annotated[bool, typer.Option("--reverse", help="The robot may drive backwards.")]
Margin = Annotated[float, typer.Option("--margin", metavar="M", help="What it keeps off obstacles.")]
OccupiedFrom = Annotated[
    float, typer.Option("--occupied-from", metavar="P", help="Cells above this probability are obstacles.")
]
UnknownCells = Annotated[Unknown, typer.Option("--unknown", help="What cells not known are.")]
TopSpeed = Annotated[float, typer.Option("--speed", metavar="M/S", help="Top speed.")]
Lateral = Annotated[
    float, typer.Option("--lateral", metavar="M/S2", help="Lateral acceleration on an arc: v^2 / radius.")
]
TurnRate = Annotated[float, typer.Option("--turn-rate", metavar="RAD/S", help="Fastest turn: v / radius.")]
Acceleration = Annotated[
    float, typer.Option("--acceleration", metavar="M/S2", help="Speeding up and slowing down.")
]


def run(
    map_path: MapArgument,
    start: Start,
    goal: Goal,
    output: PathOutput = None,
    force: Replace = False,
    radius: Radius = None,
    footprint: Outline = None,
    min_radius: Smallest = 0.2,
    turn_on_spot: OnSpot = False,
    reverse: Reverse = False,
    margin: Margin = 0.005,
    occupied_from: OccupiedFrom = 0.9,
    unknown: UnknownCells = Unknown.blocked,
    speed: TopSpeed = 1.0,
    lateral: Lateral = 0.5,
    turn_rate: TurnRate = 1.5,
    acceleration: Acceleration = 0.5,
    as_json: AsJson = False,
) -> None:
    """Plan the path of lines and arcs that takes the least time from start to goal on a map."""
    import numpy as np

    from gridslam.kernels.compiling import announcing_compilation
    from gridslam.maps.load import load_any_map
    from gridslam.planning.arcs_and_lines import PlanOptions, plan_path
    from gridslam.planning.footprint import cover_polygon, disc
    from gridslam.planning.obstacles import ROBOT_RADIUS_M
    from gridslam.planning.travel_time import SpeedLimits
    from gridslam.report.directory import check_free
    from gridslam.report.plan import plan_document, write_plan

    if radius is not None and footprint is not None:
        raise typer.BadParameter("give the radius or the corners, not both", param_hint="'--footprint'")
    if footprint is not None:
        discs = cover_polygon(np.array(_corners(footprint)))
    else:
        discs = disc(ROBOT_RADIUS_M if radius is None else radius)
    options = PlanOptions(
        discs=discs,
        min_radius_m=min_radius,
        turn_on_spot=turn_on_spot,
        reverse=reverse,
        margin_m=margin,
        occupied_from=occupied_from,
        unknown_blocks=unknown is Unknown.blocked,
        limits=SpeedLimits(speed, lateral, turn_rate, acceleration),
    )
    begin, end = np.array(_pose("--start", start, False)), np.array(_pose("--goal", goal, True))
    if output is not None:
        check_free(output, force)
    occupancy = load_any_map(map_path)
    with announcing_compilation(
        lambda: console.say("compiling the planner, once per installation: half a minute")
    ):
        plan = plan_path(occupancy, begin, end, options)
    if output is not None:
        write_plan(output, plan, occupancy, discs, map_path, force)
    if as_json:
        console.emit_json(plan_document(plan, map_path))
    else:
        _show(plan)


def _show(plan: Plan) -> None:
    """The segments for people, and what the path was chosen from."""
    import math

    rows = []
    for s in plan.path.segments:
        way = f"{math.degrees(s.angle_rad):.1f} deg" if s.kind == "turn" else f"{s.length_m:.3f} m"
        side = "" if not s.angle_rad else "left" if s.angle_rad > 0.0 else "right"
        bend = f"{s.radius_m:.3f}" if s.kind == "arc" else ""
        pose = f"{s.x:.3f}", f"{s.y:.3f}", f"{s.yaw_rad:.3f}"
        speeds = f"{s.enter_speed:.2f}-{s.top_speed:.2f}-{s.leave_speed:.2f}"
        rows.append((s.kind, *pose, way, bend, side, speeds, f"{s.time_s:.2f}"))
    console.emit_table(
        ("kind", "x m", "y m", "yaw rad", "way", "radius m", "side", "speed m/s", "time s"), rows
    )
    console.emit("")
    named = [
        (f"{'*' if c.name == plan.chosen else ' '} {c.name}", f"{c.length_m:.2f} m", f"{c.time_s:.2f} s")
        for c in plan.candidates
    ]
    console.emit_table(("candidate", "length", "time"), named)


def _pose(option: str, text: str, yaw_is_free: bool) -> tuple[float, float, float]:
    import math

    from gridslam.core.errors import ConfigError

    parts = text.split(",")
    try:
        values = [float(part) for part in parts]
    except ValueError:
        values = []
    if yaw_is_free and len(values) == 2 and all(map(math.isfinite, values)):
        return values[0], values[1], math.nan
    if len(values) != 3 or not all(map(math.isfinite, values)):
        form = "x,y,yaw or x,y" if yaw_is_free else "x,y,yaw"
        raise ConfigError(
            f"{option} {text}: expected {form} in metres and radians, for example {option} 1.5,-2,0.3"
        )
    return values[0], values[1], values[2]


def _corners(text: str) -> list[tuple[float, float]]:
    from gridslam.core.errors import ConfigError

    try:
        return [(float(x), float(y)) for x, y in (corner.split(",") for corner in text.split())]
    except ValueError:
        raise ConfigError(
            f"--footprint {text}: expected corners x,y in metres, for example '0.3,0.2 -0.2,0.2 -0.2,-0.2 0.3,-0.2'"
        ) from None
