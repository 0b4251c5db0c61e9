"""Runs of slam-sd in the tagged corridors, and what came of them; the simulated logs are kept under out/."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.association import associate
from gridslam.evaluation.object_errors import MapObject
from gridslam.evaluation.readers.files import read_trajectory
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.tag_database import TagDatabase, load_tag_database
from gridslam.methods.base import RunResult, Table
from gridslam.runs.inputs import read_inputs
from gridslam.runs.run import run_map
from gridslam.runs.run_config import load_config
from gridslam.simulation.record import record_world, truth_folder
from gridslam.simulation.world_config import load_world

Floats = NDArray[np.float64]

KEPT = Path(__file__).resolve().parents[2] / "out" / "tagged_worlds"
NEAR_M = 0.15
NEAR_DEG = 15.0
BESIDE_M = 0.5  # an estimate so far from every object stands on nothing


@dataclass(frozen=True, slots=True)
class JudgedObject:
    """One true object and what was said of it; errors are NaN where it was not found.

    `taken_for` is the class of the true object nearest to where it was reported.
    """

    id: str
    category: str
    position_m: float
    heading_deg: float
    state_right: bool
    moved: bool
    said_moved: bool | None
    taken_for: str

    @property
    def is_right(self) -> bool:
        """Near enough, turned right, and its door's state right."""
        return self.position_m <= NEAR_M and self.heading_deg <= NEAR_DEG and self.state_right


@dataclass(frozen=True, slots=True)
class ObjectScore:
    """One run against its truth."""

    judged: tuple[JudgedObject, ...]
    ape_m: float
    ghosts: (
        float  # fraction of the cells of old footprints that are occupied in the static map; NaN without any
    )
    shown: float  # fraction of the cells of present footprints that are occupied in the composed map
    cpu_ms: float  # per scan, all of the method
    stages_ms: dict[str, float]  # per scan, wall clock
    counters: dict[str, int]

    @property
    def right(self) -> int:
        """How many objects are right."""
        return sum(tagged_object.is_right for tagged_object in self.judged)


def simulated(world: str, seed: int, overrides: Sequence[str] = (), name: str = "") -> Path:
    """The log of a world, made once; one with overrides is kept under a name of its own."""
    log = KEPT / f"{name or world}-{seed}.mcap"
    if not (truth_folder(log) / "tags.yaml").exists():
        made, path = load_world(world, overrides, seed)
        KEPT.mkdir(parents=True, exist_ok=True)
        record_world(made, path.parent, log, force=True)
    return log


def mapped(
    log: Path, config: str, seed: int, overrides: Sequence[str] = (), tags: bool = True
) -> ObjectScore:
    """Map a log and judge the result."""
    truth = truth_folder(log)
    inputs = read_inputs({"tags": truth / "tags.yaml"}, "slam-sd") if tags else {}
    started = time.process_time()
    run = run_map(load_config(config, overrides, seed), log, lambda _: None, lambda: False, inputs)
    cpu_s = time.process_time() - started
    scans = max(len(run.result.trajectory), 1)
    T_truth_map, ape = aligned(run.result.trajectory, read_trajectory(truth / "trajectory.tum"))
    database = load_tag_database(truth / "tags.yaml")
    return ObjectScore(
        judged(run.result, truth / "objects.csv", T_truth_map),
        ape,
        ghosts(run.result, truth, T_truth_map, database),
        shown(run.result, truth, T_truth_map, database),
        1e3 * cpu_s / scans,
        {stage: 1e3 * seconds / scans for stage, seconds in run.result.timings_s.items()},
        dict(run.result.counters),
    )


def aligned(estimate: Trajectory, truth: Trajectory) -> tuple[Floats, float]:
    """T_truth_map (3,) by least squares over the trajectories, and the rmse of the positions that is left (m)."""
    pairs = associate(estimate, truth, "interpolate")
    alignment = find_alignment(pairs.estimate, pairs.truth, "se2")
    assert alignment is not None
    error = alignment.apply(pairs.estimate)[:, :2] - pairs.truth[:, :2]
    return alignment.T_truth_estimate, float(np.sqrt((error**2).sum(axis=1).mean()))


def judged(result: RunResult, truth: Path, T_truth_map: Floats) -> tuple[JudgedObject, ...]:
    """All true objects with what the run says of them."""
    true = read_objects(truth)
    found = objects_of(result.tables.get("objects"))
    return tuple(
        _judge(name, tagged_object, found.get(name), true, T_truth_map)
        for name, tagged_object in true.items()
    )


def objects_of(table: Table | None) -> dict[str, MapObject]:
    """The objects of a run's table, by id."""
    if table is None:
        return {}
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    return {
        str(row["id"]): MapObject(
            (float(str(row["x"])), float(str(row["y"])), float(str(row["yaw"]))),
            str(row["class"]),
            row["moved"] == "true",
            str(row["state"]) or None,
        )
        for row in rows
    }


def _judge(
    name: str,
    tagged_object: MapObject,
    found: MapObject | None,
    true: dict[str, MapObject],
    T_truth_map: Floats,
) -> JudgedObject:
    category = tagged_object.category or ""
    if found is None:
        return JudgedObject(name, category, np.nan, np.nan, False, bool(tagged_object.moved), None, "missed")
    here = se2.compose(T_truth_map, np.array(found.pose))
    error = se2.between(np.array(tagged_object.pose), here)
    away = {other: float(np.hypot(*(np.array(o.pose) - here)[:2])) for other, o in true.items()}
    nearest = min(away, key=away.__getitem__)
    return JudgedObject(
        name,
        category,
        float(np.hypot(error[0], error[1])),
        float(np.degrees(abs(error[2]))),
        found.state == tagged_object.state,
        bool(tagged_object.moved),
        found.moved,
        (true[nearest].category or "") if away[nearest] < BESIDE_M else "nothing",
    )


def ghosts(result: RunResult, truth: Path, T_truth_map: Floats, database: TagDatabase) -> float:
    """The fraction of the cells in old footprints of moved boxes that are occupied in the static map."""
    static = result.maps.get("static", result.occupancy)
    if static is None:
        return float("nan")
    now = read_objects(truth / "objects.csv")
    world, _ = load_world(str(truth / "world.yaml"))
    footprints = {tagged_object.id: np.array(tagged_object.footprint) for tagged_object in database.objects}
    occupied = cells = 0
    for tagged_object in world.objects:
        if not tagged_object.tag or not tagged_object.moves:
            continue
        before = np.array([*tagged_object.pose[:2], np.radians(tagged_object.pose[2])])
        inside = _cells_of(static, T_truth_map, before, footprints[tagged_object.id])
        inside &= ~_cells_of(
            static, T_truth_map, np.array(now[tagged_object.id].pose), footprints[tagged_object.id]
        )
        cells += int(inside.sum())
        occupied += int((inside & (np.nan_to_num(static.probability) > 0.65)).sum())
    return occupied / cells if cells else float("nan")


def shown(result: RunResult, truth: Path, T_truth_map: Floats, database: TagDatabase) -> float:
    """The fraction of the cells in true present footprints of boxes that are occupied in the composed map."""
    composed = result.maps.get("composed")
    if composed is None:
        return float("nan")
    now = read_objects(truth / "objects.csv")
    boxes = [tagged_object for tagged_object in database.objects if not tagged_object.is_door]
    inside = np.zeros(composed.probability.shape, np.bool_)
    for box in boxes:
        inside |= _cells_of(composed, T_truth_map, np.array(now[box.id].pose), np.array(box.footprint))
    return float((np.nan_to_num(composed.probability[inside]) > 0.65).mean())


def _cells_of(grid: OccupancyGrid, T_truth_map: Floats, pose: Floats, footprint: Floats) -> NDArray[np.bool_]:
    """The cells whose centres a rectangle at a pose of the true frame covers."""
    inside = np.zeros(grid.probability.shape, np.bool_)
    middle = se2.transform_points(se2.inverse(T_truth_map), pose[None, :2])
    radius = int(np.ceil(np.hypot(*footprint.T).max() / grid.geometry.resolution_m)) + 2
    row, col = (int(v) for v in grid.geometry.cells(middle)[0])
    rows = np.arange(max(row - radius, 0), min(row + radius, inside.shape[0]))
    cols = np.arange(max(col - radius, 0), min(col + radius, inside.shape[1]))
    cells = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2)
    centres = se2.transform_points(T_truth_map, grid.geometry.centres(cells))
    local = se2.transform_points(se2.inverse(pose), centres)
    covered = ((local > footprint.min(axis=0)) & (local < footprint.max(axis=0))).all(axis=1)
    inside[cells[covered, 0], cells[covered, 1]] = True
    return inside
