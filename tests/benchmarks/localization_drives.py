"""Short drives by seed on which localization is judged: in ordinary and changed places, crowds, symmetric corridors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.messages import Event
from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.base import RunResult
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.simulation.places.build import place_document
from gridslam.simulation.places.config import Kind
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import load_world, validate_world
from tests.benchmarks.bench_relocalization import crowded
from tests.benchmarks.drawn_places import drive

Floats = NDArray[np.float64]

BOXES = 40  # new in a changed place
BOX_SIZE_M = (0.4, 1.2)
ASIDE_M = (0.9, 2.5)  # of a box from the route
# Of the route that a drive is the beginning of: wheels are made for the drift over 100 m
WHOLE_TRAVEL_M = 150.0
AROUND_M = 12.0
KINDS: tuple[Kind, ...] = ("office", "corridors")


@dataclass(frozen=True)
class LocalizationDrive:
    """What a robot recorded, its true path in the frame of the map, and the right map."""

    name: str
    events: tuple[Event, ...]
    truth: Trajectory
    grid: OccupancyGrid


def place_drive(seed: int, travel_m: float, crowd: bool = False, changed: bool = False) -> LocalizationDrive:
    """A drive through the place of a seed, on its true map: among people, or with boxes that the map lacks."""
    kind = KINDS[seed % len(KINDS)]
    document = _shortened(place_document(kind, seed, WHOLE_TRAVEL_M), travel_m)
    grid = None
    if changed:
        world = validate_world(document, "place")
        grid = true_map(Simulator(world, Path()).scene, world.truth)
        document = document | {"boxes": _boxes(document, np.random.default_rng([seed, 5]))}
    recorded = drive(validate_world(document, "place"), Path())
    events = list(recorded.events)
    if crowd:
        events = crowded(events, np.random.default_rng([seed, 7]))
    name = f"{kind} {seed}{' in a crowd' if crowd else ''}{' changed' if changed else ''}"
    return LocalizationDrive(
        name, tuple(events), recorded.truth, around(grid or recorded.grid, recorded.truth)
    )


def around(grid: OccupancyGrid, path: Trajectory) -> OccupancyGrid:
    """The part of the map about a path: a search of a whole campus takes a minute."""
    corners = np.stack([path.poses[:, :2].min(axis=0) - AROUND_M, path.poses[:, :2].max(axis=0) + AROUND_M])
    (first_row, first_col), (last_row, last_col) = np.maximum(grid.geometry.cells(corners), 0)
    part = grid.probability[first_row:last_row, first_col:last_col]
    cell, (x, y) = grid.geometry.resolution_m, grid.geometry.origin_xy_m
    origin = (x + first_col * cell, y + first_row * cell)
    return OccupancyGrid(np.ascontiguousarray(part), GridGeometry(cell, origin))


def corridor_drive(seed: int) -> LocalizationDrive:
    """A drive along a corridor that looks the same everywhere and from both ends, without its fixed cameras."""
    rng = np.random.default_rng([seed, 3])
    first, second, third = rng.uniform(3.0, 27.0, 3).round(2).tolist()
    settings = (
        "fixed_cameras=[]",
        "sensors.cameras=[]",
        f"robot.start=[{first}, 1.3, 0]",
        f"robot.route=[[{second}, 1.3], [{third}, 1.3]]",
    )
    world, _ = load_world("ispace-corridor", settings, seed)
    recorded = drive(world, Path())
    return LocalizationDrive(f"corridor {seed}", recorded.events, recorded.truth, recorded.grid)


def localized(drive: LocalizationDrive, grid: OccupancyGrid, seed: int) -> RunResult:
    """The result of a localization from an unknown start."""
    method = IspaceMcl(IspaceMclConfig(), seed, grid)
    for event in drive.events:
        method.process(event)
    return method.result()


def mirrored(grid: OccupancyGrid) -> OccupancyGrid:
    """The map with y negated about its centre line."""
    return OccupancyGrid(np.ascontiguousarray(grid.probability[::-1]), grid.geometry)


def rescaled(grid: OccupancyGrid, factor: float) -> OccupancyGrid:
    """The map with cells that are said to be larger by a factor."""
    geometry = grid.geometry
    return OccupancyGrid(grid.probability, GridGeometry(geometry.resolution_m * factor, geometry.origin_xy_m))


def negated(grid: OccupancyGrid) -> OccupancyGrid:
    """The map with walls and floor exchanged."""
    return OccupancyGrid(np.float32(1.0) - grid.probability, grid.geometry)


def cropped(drive: LocalizationDrive, margin_m: float) -> OccupancyGrid | None:
    """The larger part of the map beside the drive's bounding box; None if nothing of it is left."""
    grid, cell = drive.grid, drive.grid.geometry.resolution_m
    low, high = drive.truth.poses[:, :2].min(axis=0), drive.truth.poses[:, :2].max(axis=0)
    rows, cols = grid.probability.shape
    (first_row, first_col), (last_row, last_col) = grid.geometry.cells(
        np.stack([low - margin_m, high + margin_m])
    )
    parts = [
        (slice(0, rows), slice(min(last_col, cols), cols)),
        (slice(0, rows), slice(0, max(first_col, 0))),
        (slice(min(last_row, rows), rows), slice(0, cols)),
        (slice(0, max(first_row, 0)), slice(0, cols)),
    ]
    best = max(parts, key=lambda part: int((grid.probability[part] < 0.5).sum()))
    if (grid.probability[best] < 0.5).sum() * cell**2 < 20.0:
        return None
    x, y = grid.geometry.origin_xy_m
    origin = (x + best[1].start * cell, y + best[0].start * cell)
    return OccupancyGrid(np.ascontiguousarray(grid.probability[best]), GridGeometry(cell, origin))


def wall_points(grid: OccupancyGrid) -> Floats:
    """Centres `(n, 2)` of the occupied cells."""
    return grid.geometry.centres(np.argwhere(np.nan_to_num(grid.probability, nan=0.0) > 0.65))


def errors_m(result: RunResult, truth: Trajectory) -> tuple[Floats, NDArray[np.bool_]]:
    """Position errors `(n,)` of the poses at whose stamps the truth is known, and whether each was called localized."""
    at, inside = truth.at(result.trajectory.stamps_ns)
    off = result.trajectory.poses[inside, :2] - at[inside, :2]
    table = result.tables["localization"]
    column = table.columns.index("status")
    called = np.array([row[column] == "localized" for row in table.rows])
    return np.hypot(off[:, 0], off[:, 1]), called[inside]


def _shortened(document: dict[str, Any], travel_m: float) -> dict[str, Any]:
    """The document with the first `travel_m` of its route."""
    robot = document["robot"]
    route = np.array([robot["start"][:2], *robot["route"]], np.float64)
    travel = np.cumsum(np.hypot(*np.diff(route, axis=0).T))
    legs = int(np.searchsorted(travel, travel_m)) + 1
    return document | {"robot": robot | {"route": robot["route"][:legs]}}


def _boxes(document: dict[str, Any], rng: np.random.Generator) -> list[dict[str, Any]]:
    """Boxes beside the route, none of them on it."""
    route = np.array([document["robot"]["start"][:2], *document["robot"]["route"]], np.float64)
    legs = np.diff(route, axis=0)
    at = np.concatenate(
        [a + np.linspace(0.0, 1.0, 30)[:, None] * leg for a, leg in zip(route[:-1], legs, strict=True)]
    )
    tree, boxes = cKDTree(at), []
    for _ in range(20 * BOXES):
        bearing = rng.uniform(-np.pi, np.pi)
        centre = at[rng.integers(len(at))] + rng.uniform(*ASIDE_M) * np.array(
            [np.cos(bearing), np.sin(bearing)]
        )
        size = rng.uniform(*BOX_SIZE_M, 2)
        if tree.query(centre)[0] > 0.5 + 0.5 * np.hypot(*size):
            yaw = float(np.degrees(se2.wrap_angle(rng.uniform(-np.pi, np.pi))))
            boxes.append({"centre": centre.round(3).tolist(), "size": size.round(3).tolist(), "yaw_deg": yaw})
        if len(boxes) == BOXES:
            break
    return boxes
