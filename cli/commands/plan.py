"""gridslam plan"""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import console
from ..options import AsJson

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from gridslam.planning.arcs_and_lines import PlannedPath


FIRST_NOTICE_POSES = 150_000


class Unknown(str, Enum):
    """Whether the robot may enter unknown cells."""

    blocked = "blocked"
    free = "free"


MapArgument = Annotated[
    Path, typer.Argument(metavar="MAP", readable=False, help="A map: a map_server YAML, or wean.dat(.gz).")
]
Start = Annotated[
    str, typer.Option("--start", metavar="X,Y,YAW", help="Start pose of the robot (m, m, rad).")
]
Goal = Annotated[
    str, typer.Option("--goal", metavar="X,Y[,YAW]", help="Goal pose; without yaw, any heading.")
]
PathOutput = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="DIR", help="Write path.csv, segments.csv, path.png, report.json."
    ),
]
Replace = Annotated[bool, typer.Option("--force", help="Replace existing output.")]
Radius = Annotated[
    float | None,
    typer.Option("--radius", metavar="M", help="Radius of a round robot, above 0 (default 0.2)."),
]
Footprint = Annotated[
    str | None,
    typer.Option(
        "--footprint",
        metavar="'X,Y X,Y ...'",
        help="Corners of a convex footprint, instead of --radius.",
    ),
]
MinRadius = Annotated[float, typer.Option("--min-radius", metavar="M", help="Smallest turning radius.")]
TurnInPlace = Annotated[
    bool,
    typer.Option(
        "--turn-on-spot", help="The robot may turn on the spot at both ends; with --min-radius 0, anywhere."
    ),
]
Reverse = Annotated[bool, typer.Option("--reverse", help="The robot may drive backwards.")]
Margin = Annotated[float, typer.Option("--margin", metavar="M", help="Clearance from obstacles.")]
OccupiedFrom = Annotated[
    float, typer.Option("--occupied-from", metavar="P", help="Cells above this probability are obstacles.")
]
UnknownCells = Annotated[Unknown, typer.Option("--unknown", help="Whether unknown cells block the robot.")]
TopSpeed = Annotated[float, typer.Option("--speed", metavar="M/S", help="Top speed.")]
Lateral = Annotated[
    float, typer.Option("--lateral", metavar="M/S2", help="Lateral acceleration on an arc: v^2 / radius.")
]
TurnRate = Annotated[
    float, typer.Option("--turn-rate", metavar="RAD/S", help="Highest yaw rate: v / radius.")
]
Acceleration = Annotated[
    float, typer.Option("--acceleration", metavar="M/S2", help="Acceleration and deceleration.")
]


def run(
    map_path: MapArgument,
    start: Start,
    goal: Goal,
    output: PathOutput = None,
    force: Replace = False,
    radius: Radius = None,
    footprint: Footprint = None,
    min_radius: MinRadius = 0.2,
    turn_on_spot: TurnInPlace = False,
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
    """Plan the fastest path of lines and arcs from start to goal on a map."""
    import numpy as np

    from gridslam.kernels.compiling import announcing_compilation
    from gridslam.maps.load import load_any_map, map_files
    from gridslam.planning.arcs_and_lines import plan_path
    from gridslam.planning.options import PlanOptions
    from gridslam.planning.travel_time import SpeedLimits
    from gridslam.report.directory import check_free
    from gridslam.report.plan import plan_document, write_plan

    from ..interruption import finishing

    options = PlanOptions(
        discs=_discs_of_robot(radius, footprint),
        min_radius_m=min_radius,
        turn_on_spot=turn_on_spot,
        reverse=reverse,
        margin_m=margin,
        occupied_from=occupied_from,
        unknown_blocks=unknown is Unknown.blocked,
        limits=SpeedLimits(
            top_speed_mps=speed,
            lateral_mps2=lateral,
            turn_rate_radps=turn_rate,
            acceleration_mps2=acceleration,
        ),
    )
    start_pose, goal_pose = np.array([_pose("--start", start, False), _pose("--goal", goal, True)])
    before = check_free(output, force, map_files(map_path)) if output is not None else None
    occupancy = load_any_map(map_path)
    with announcing_compilation(_say_compiling):
        plan = plan_path(occupancy, start_pose, goal_pose, options, report=_SearchNotice())
    with finishing():
        if output is not None:
            write_plan(output, plan, occupancy, options.discs, map_path, force=force, before=before)
        if as_json:
            console.emit_json(plan_document(plan, map_path))
        else:
            _show(plan)


def _say_compiling() -> None:
    console.say("compiling the planner, once per installation: half a minute")


def _discs_of_robot(radius_m: float | None, footprint: str | None) -> NDArray[np.float64]:
    """The discs `(n, 3)` (x, y, radius; m) that cover the robot. Raises BadParameter: radius and footprint are both given."""
    import numpy as np

    from gridslam.planning.footprint import cover_polygon, disc
    from gridslam.planning.obstacles import ROBOT_RADIUS_M

    if radius_m is not None and footprint is not None:
        raise typer.BadParameter("give --radius or --footprint, not both", param_hint="'--footprint'")
    if footprint is not None:
        return cover_polygon(np.array(_corners(footprint)))
    return disc(ROBOT_RADIUS_M if radius_m is None else radius_m)


class _SearchNotice:
    """Says on stderr that a search takes long, each time the number of poses has doubled."""

    def __init__(self) -> None:
        self._next = FIRST_NOTICE_POSES

    def __call__(self, poses: int) -> None:
        if poses >= self._next:
            console.say(f"searching: {poses} poses so far")
            self._next *= 2


def _show(plan: PlannedPath) -> None:
    """Print the segments and the candidates."""
    import math

    rows = []
    for s in plan.path.segments:
        extent = f"{math.degrees(s.angle_rad):.1f} deg" if s.kind == "turn" else f"{s.length_m:.3f} m"
        side = "" if not s.angle_rad else "left" if s.angle_rad > 0.0 else "right"
        radius = f"{s.radius_m:.3f}" if s.kind == "arc" else ""
        pose = f"{s.x:.3f}", f"{s.y:.3f}", f"{s.yaw_rad:.3f}"
        speeds = f"{s.enter_speed:.2f}-{s.top_speed:.2f}-{s.leave_speed:.2f}"
        rows.append((s.kind, *pose, extent, radius, side, speeds, f"{s.time_s:.2f}"))
    console.emit_table(
        ("kind", "x m", "y m", "yaw rad", "length", "radius m", "side", "speed m/s", "time s"), rows
    )
    console.emit("")
    named = [
        (f"{'*' if c.name == plan.chosen else ' '} {c.name}", f"{c.length_m:.2f} m", f"{c.time_s:.2f} s")
        for c in plan.candidates
    ]
    console.emit_table(("candidate", "length", "time"), named)


def _pose(option: str, text: str, yaw_is_free: bool) -> tuple[float, float, float]:
    import math

    from ..coordinates import coordinates

    form = f"{'x,y,yaw or x,y' if yaw_is_free else 'x,y,yaw'} in metres and radians, for example {option} 1.5,-2,0.3"
    x, y, *yaw = coordinates(option, text, (2, 3) if yaw_is_free else (3,), form)
    return x, y, yaw[0] if yaw else math.nan


def _corners(text: str) -> list[list[float]]:
    from ..coordinates import coordinates

    form = "corners x,y in metres, for example '0.3,0.2 -0.2,0.2 -0.2,-0.2 0.3,-0.2'"
    return [coordinates("--footprint", corner, (2,), form) for corner in text.split()]
