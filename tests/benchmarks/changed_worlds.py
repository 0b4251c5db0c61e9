"""Places of which some furniture and shut doors stand in one drive and not in the next, and how well the changes are found.

Furniture stands in rooms and corridors, up to the walls, but in no wall, and where no door shuts. Only the places called
`office` have doors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Odometry
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sessions.session_file import read_session
from gridslam.methods.base import RunResult
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import SlamSd
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.places.build import place_document
from gridslam.simulation.places.config import Kind
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import validate_world

Floats = NDArray[np.float64]

TRAVEL_M = 150.0
CHANGED_RATIO = 0.2  # of the furniture is absent, and of the doors shut, in each drive
DOOR_WIDTHS_M = 0.9, 1.15  # between the ends of two walls
CELL_M = 0.05
FURNITURE = 30  # pieces
CLEARANCE_M = 0.45  # of the route


@dataclass(frozen=True, slots=True)
class Drives:
    """The results of three drives, each continuing those before it, and of each alone; the truth of all, and the pieces.

    `static` are points `(n, 2)` of the walls that stand in all drives, `worlds` the documents of the worlds.
    """

    results: list[RunResult]
    alone: list[RunResult]
    truths: list[Trajectory]
    appeared: list[list[Floats]]  # corners (4, 2) of the pieces that are new in drive k
    vanished: list[list[Floats]]
    static: Floats
    worlds: list[dict[str, Any]]


def drives_of(kind: Kind, seed: int, number: int = 3, travel_m: float = TRAVEL_M) -> Drives:
    """Drives through a place of which a fifth of the furniture changes each time."""
    document = place_document(kind, seed, travel_m)
    rng = np.random.default_rng(seed)
    route = _route(document["robot"])
    walls = [*document["walls"]]
    shut = doors(document["walls"], route)
    walls += furniture(route, _sides(walls), rng, _sides(shut) if shut else np.zeros((0, 2, 2)))
    pieces = np.arange(len(document["walls"]), len(walls))
    walls += shut
    leaves = np.arange(pieces[-1] + 1, len(walls))
    absent = [
        set(rng.permutation(pieces)[: round(CHANGED_RATIO * len(pieces))].tolist())
        | set(rng.permutation(leaves)[round(CHANGED_RATIO * len(leaves)) :].tolist())
        for _ in range(number)
    ]
    results, alone, truths, worlds = [], [], [], []
    session = None
    for k, missing in enumerate(absent):
        world = {
            **document,
            "seed": 1000 * seed + k,
            "walls": [w for i, w in enumerate(walls) if i not in missing],
        }
        worlds.append(world)
        truth: list[tuple[int, float, float, float]] = []
        events = list(recorded(world, truth))
        own = _mapped(events, None, f"drive {k + 1}")
        joint = own if session is None else _mapped(events, session, f"drive {k + 1}")
        session = joint.files["session.npz"]
        results.append(joint)
        alone.append(own)
        rows = np.array(truth)
        truths.append(Trajectory(rows[:, 0].astype(np.int64), rows[:, 1:]))

    def corners(chosen: set[int]) -> list[Floats]:
        return [np.array(walls[i]["points"], np.float64) for i in sorted(chosen)]

    new = [set[int]()] + [absent[k - 1] - absent[k] for k in range(1, number)]
    gone = [set[int]()] + [absent[k] - absent[k - 1] for k in range(1, number)]
    static = np.concatenate([dense(a, b) for a, b in _sides(document["walls"])])
    changed = [corners(c) for c in new], [corners(c) for c in gone]
    return Drives(results, alone, truths, *changed, static, worlds)


def _route(robot: dict[str, object]) -> Floats:
    """Points `(n, 2)` 0.2 m apart along the route."""
    route = np.array([robot["start"][:2], *(point[:2] for point in robot["route"])], np.float64)  # type: ignore[index, union-attr]
    return np.concatenate(
        [np.linspace(a, b, max(int(np.hypot(*(b - a)) / 0.2), 2)) for a, b in pairwise(route)]
    )


def _sides(walls: Sequence[Mapping[str, Any]]) -> Floats:
    """The segments `(n, 2, 2)` of walls."""
    pieces = []
    for wall in walls:
        points = np.array([*wall["points"], *wall["points"][: bool(wall.get("closed"))]], np.float64)
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(pieces)


def furniture(
    route: Floats, sides: Floats, rng: np.random.Generator, leaves: Floats
) -> list[dict[str, object]]:
    """Boxes beside the route, in view of it and clear of the robot; they cross neither walls, nor shut doors, nor each other."""
    found: list[dict[str, object]] = []
    while len(found) < FURNITURE:
        centre = route[rng.integers(len(route))] + rng.uniform(-2.5, 2.5, 2)
        size, yaw = rng.uniform(0.35, 0.9, 2), rng.uniform(-np.pi, np.pi)
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * 0.5 * size
        points = se2.transform_points(np.array([*centre, yaw]), corners).round(3)
        away = np.hypot(*(route - centre).T)
        if away.min() <= CLEARANCE_M + 0.5 * float(np.hypot(*size)):
            continue
        box: dict[str, object] = {"points": points.tolist(), "closed": True}
        own, view = _sides([box]), np.stack([route[away.argmin()], centre])[None]
        lines = np.concatenate([own, points.reshape(2, 2, 2)])
        if not (crosses(np.concatenate([view, lines]), sides) or crosses(lines, leaves)):
            found.append(box)
            sides = np.concatenate([sides, own])
    return found


def crosses(segments: Floats, others: Floats) -> bool:
    """Whether any of the segments `(n, 2, 2)` crosses any of the others `(m, 2, 2)`."""
    is_near = (others.min(axis=1) <= segments.max(axis=(0, 1))).all(axis=1)
    others = others[is_near & (others.max(axis=1) >= segments.min(axis=(0, 1))).all(axis=1)]
    a, b = segments[:, None, 0], segments[:, None, 1]
    c, d = others[None, :, 0], others[None, :, 1]

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    return bool(((side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)).any())


def doors(walls: Sequence[Mapping[str, Any]], route: Floats) -> list[dict[str, object]]:
    """A leaf for every gap as wide as a door between the ends of two walls that the robot does not drive through."""
    open_walls = [np.array(wall["points"], np.float64) for wall in walls if not wall.get("closed")]
    found: list[dict[str, object]] = []
    for one, other in permutations(open_walls, 2):
        leaf = np.stack([one[-1], other[0]])
        width = float(np.hypot(*(leaf[1] - leaf[0])))
        if not DOOR_WIDTHS_M[0] < width < DOOR_WIDTHS_M[1]:
            continue
        if np.hypot(*(route - leaf.mean(axis=0)).T).min() > CLEARANCE_M + 0.5 * width:
            found.append({"points": leaf.tolist()})
    return found


def recorded(world: dict[str, Any], truth: list[tuple[int, float, float, float]]) -> Iterator[Event]:
    """The events of a drive through a world; its true poses are appended to `truth`."""
    for event, is_truth in drive_route(Simulator(validate_world(world, "place"), Path())):
        if is_truth:
            assert isinstance(event, Odometry)
            truth.append((event.stamp_ns, event.x_m, event.y_m, event.yaw_rad))
        else:
            yield event


def _mapped(events: list[Event], session: bytes | None, log: str) -> RunResult:
    known = None if session is None else read_session(session, "session.npz")
    method = SlamSd(SlamSdConfig(), 0, session=known, log_name=log)
    for event in events:
        method.process(event)
    return method.result()


def dense(a: Floats, b: Floats) -> Floats:
    """Points about a cell apart from a to b."""
    return np.linspace(a, b, max(int(np.hypot(*(b - a)) / CELL_M), 2))
