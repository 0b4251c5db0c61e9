"""Explorations in the simulator with many seeds: whether they finish without contact, and the errors of the map.

`python -m tests.benchmarks.explorations OUT [SET ...]` runs sets of trials and prints their tables. Each run is a line in
OUT/runs.jsonl with a picture beside it; runs that exist already are not repeated. SET:N takes N seeds.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.association import associate
from gridslam.evaluation.map_errors import wall_distances
from gridslam.maps.distances import distances_to
from gridslam.maps.map_server import load_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.planning.art_gallery import gallery_of, scatter
from gridslam.runs.explore import Explored, explore
from gridslam.runs.inputs import read_inputs
from gridslam.runs.run_config import load_config
from gridslam.simulation.shapes import Box, Wall
from gridslam.simulation.world_config import WorldConfig, load_world, validate_world
from tests.benchmarks.harness import say
from tests.benchmarks.real_places import data_dir
from tests.conftest import REPOSITORY

DRAWINGS = REPOSITORY / "configs" / "worlds" / "drawings"
COVERED_M = 0.15  # a true wall this close to a mapped one is covered
ROBOT_M = 0.3  # distance to walls that the robot can keep
SEEN_WITHIN_M = 8.0


@dataclass(frozen=True, slots=True)
class ExplorationTrial:
    """A world, a drawing of it, the start in the drawing, and changes to world and settings."""

    name: str
    world: str | WorldConfig
    drawing: Path
    start: tuple[float, float, float]
    seeds: tuple[int, ...]
    settings: tuple[str, ...] = ()
    folder: Path = Path()
    boxes: int = 0  # placed at random in the corridor, different for each seed
    walls: tuple[Wall, ...] = ()
    config: str = "handmap-slam"
    world_settings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ExplorationResult:
    """Figures of one run; errors in metres.

    The paper's "mean distance between corresponding points of the true and the built map" is `mean_distance_m`: each point of one
    map corresponds to the nearest of the other, both ways round. One way alone would not count walls that were never mapped.
    """

    trial: str
    seed: int
    ended: str
    duration_s: float
    travelled_m: float
    clearance_m: float
    map_error_m: float  # mean distance from a mapped wall cell to the nearest true one
    completeness_m: float  # and from a true one to the nearest mapped one
    coverage: float  # fraction of the true walls that border on reachable_speeds space and are mapped
    unreachable: int
    scale_x: float
    scale_y: float
    cpu_s: float
    reasons: list[str] = field(default_factory=list)

    @property
    def mean_distance_m(self) -> float:
        """Mean of both directions."""
        return 0.5 * (self.map_error_m + self.completeness_m)


def run_trial(trial: ExplorationTrial, seed: int, pictures: Path | None = None) -> ExplorationResult:
    """One run."""
    world, world_path = _world_of(trial, seed)
    x, y, yaw = trial.start
    config = load_config(trial.config, [f"method.start=[{x}, {y}, {yaw}]", *trial.settings], seed)
    inputs = read_inputs({"drawing": trial.drawing}, "handmap-slam")
    with tempfile.TemporaryDirectory() as name:
        folder, started = Path(name), time.process_time()
        done = explore(config, world, world_path, inputs, folder, lambda _: None, lambda: False)
        result = _result(trial, seed, done, folder, time.process_time() - started)
    if pictures is not None:
        made = done.run.result.pictures.get("exploration")
        if made is not None:
            Image.fromarray(made.rgb).save(pictures / f"{trial.name}-{seed}.png")
    return result


def _world_of(trial: ExplorationTrial, seed: int) -> tuple[WorldConfig, Path]:
    if isinstance(trial.world, WorldConfig):
        world, path = trial.world.model_copy(update={"seed": seed}), trial.folder / "world.yaml"
        path = path if path.exists() else DRAWINGS / "corridor.png"
    else:
        world, path = load_world(trial.world, trial.world_settings, seed)
    boxes = tuple(_random_boxes(world, trial.boxes, seed)) if trial.boxes else ()
    return world.model_copy(
        update={"boxes": (*world.boxes, *boxes), "walls": (*world.walls, *trial.walls)}
    ), path


def _random_boxes(world: WorldConfig, count: int, seed: int) -> Iterator[Box]:
    """Boxes in a corridor along x that leave a passage of at least 1 m, away from the start."""
    rng = np.random.default_rng([seed, count])
    length, width = (world.walls[0].rectangle or (0, 0, 25, 4))[2:]
    for k in range(count):
        size = rng.uniform(0.3, 1.2, 2)
        x = 4.0 + (length - 6.0) * (k + rng.uniform(0.2, 0.8)) / count
        y = rng.uniform(0.6, width - 0.6)
        yield Box(
            centre=(float(x), float(y)),
            size=(float(size[0]), float(size[1])),
            yaw_deg=float(rng.uniform(0, 90)),
        )


def _result(
    trial: ExplorationTrial, seed: int, done: Explored, folder: Path, cpu_s: float
) -> ExplorationResult:
    result, truth = done.run.result, done.run.truth
    facts, drawing = result.measures["exploration"], result.measures["drawing"]
    assert isinstance(facts, dict) and isinstance(drawing, dict)
    error = completeness = coverage = float("nan")
    if result.occupancy is not None and truth is not None:
        pairs = associate(result.trajectory.sorted(), truth.sorted(), "interpolate", 200_000_000)
        alignment = find_alignment(pairs.estimate, pairs.truth, "se2", False)
        if alignment is not None:
            true = load_map(folder / "truth" / "map.yaml")
            distances = wall_distances(result.occupancy, true, alignment.T_truth_estimate)
            error, completeness = float(distances.accuracy.mean()), float(distances.completeness.mean())
            coverage = coverage_of(result.occupancy, true, alignment.T_truth_estimate, done.run.truth)
    missed = [f"({m['x']:.1f}, {m['y']:.1f}) {m['reason']}" for m in facts["unreachable"]]
    return ExplorationResult(
        trial.name, seed, done.ended, done.duration_s, done.travelled_m, float(done.clearance_m), error, completeness, coverage,
        len(missed), float(drawing.get("scale_x", "nan")), float(drawing.get("scale_y", "nan")), cpu_s, missed,
    )  # fmt: skip


def coverage_of(
    built: OccupancyGrid, true: OccupancyGrid, T_truth_built: NDArray[np.float64], path: Trajectory | None
) -> float:
    """Fraction of the true walls visible from where the robot can drive that are mapped within 15 cm."""
    assert path is not None
    step = true.geometry.resolution_m
    walls, free = true.probability > 0.5, true.probability < 0.5
    roomy = (distances_to(walls) * step > ROBOT_M).astype(np.uint8)
    labels = np.asarray(cv2.connectedComponents(roomy, connectivity=4)[1])
    row, col = true.geometry.cells(path.poses[:1, :2])[0]
    standable = (labels == labels[row, col]) & (labels > 0)
    gallery = gallery_of(walls, np.asarray(free))
    places = scatter(np.asarray(standable), 400, np.random.default_rng(0))
    coverable = gallery.visible_from(places, SEEN_WITHIN_M / step).any(axis=0)
    cells = np.column_stack(np.unravel_index(gallery.cells[coverable], walls.shape))
    mapped = built.geometry.centres(np.argwhere(built.probability > 0.5))
    nearest, _ = cKDTree(se2.transform_points(T_truth_built, mapped)).query(true.geometry.centres(cells))
    return float((nearest < COVERED_M).mean())


CORRIDOR_START = (2.7, 3.2, 0.0)
BUILDING_START = (2.4, 10.4, 0.0)
PAPER = "paper/handmap-slam"
UNCORRECTED = ("method.correction=false",)
KINDS = (("corrected", ()), ("uncorrected", UNCORRECTED))
KIND_TITLES = {
    "": "best settings",
    "paper": "the paper's form, lidar of 50 m",
    "paper-8m": "the paper's form, lidar of 8 m",
}
LENGTHS_M = (20, 25, 30, 35)
DRAWN_M = 25


def corridor_trials(kind: str, config: str, world_settings: tuple[str, ...] = ()) -> list[ExplorationTrial]:
    """The corridors of four lengths with the drawing of one of them, with and without correction."""
    return [
        ExplorationTrial(
            f"corridor-{m}-{kind}{how}",
            f"hand-corridor-{m}",
            DRAWINGS / "corridor.png",
            CORRIDOR_START,
            tuple(range(10)),
            settings,
            config=config,
            world_settings=world_settings,
        )
        for m in LENGTHS_M
        for how, settings in KINDS
    ]


def trials() -> dict[str, list[ExplorationTrial]]:
    """All sets by name; those that need the real drawings only where these are."""
    ten, five = tuple(range(10)), tuple(range(5))
    corridor, building = DRAWINGS / "corridor.png", DRAWINGS / "building.png"
    distorted = DRAWINGS / "building-distorted.png"
    sets = {
        "corridors": corridor_trials("", "handmap-slam"),
        "corridors-paper": corridor_trials("paper-", PAPER),
        "corridors-paper-8m": corridor_trials("paper-8m-", PAPER, ("sensors.lidar.range_max_m=8",)),
        "building": [
            ExplorationTrial("building", "hand-building", building, BUILDING_START, ten),
            ExplorationTrial("building-distorted", "hand-building", distorted, BUILDING_START, ten),
        ],
        "building-paper": [
            ExplorationTrial(
                f"{name}-paper-{how}", "hand-building", drawing, BUILDING_START, ten, settings, config=PAPER
            )
            for name, drawing in (("building", building), ("building-distorted", distorted))
            for how, settings in KINDS
        ],
        "building-uncorrected": [
            ExplorationTrial(
                f"{name}-uncorrected", "hand-building", drawing, BUILDING_START, ten, UNCORRECTED
            )
            for name, drawing in (("building", building), ("building-distorted", distorted))
        ],
        "boxes": [
            ExplorationTrial("boxes", "hand-corridor-25", corridor, CORRIDOR_START, tuple(range(50)), boxes=5)
        ],
        "curved": [
            ExplorationTrial("curved", "hand-curved", DRAWINGS / "curved.png", (2.44, 2.27, 0.0), five),
            ExplorationTrial("round", "hand-round", DRAWINGS / "round.png", (2.13, 7.73, 0.0), five),
        ],
        "changed": [
            ExplorationTrial(
                "walled-up", "hand-building", building, BUILDING_START, five, walls=(WALLED_UP,)
            ),
            ExplorationTrial("extra-door", _with_extra_door(), building, BUILDING_START, five),
        ],
    }
    folder = data_dir()
    if folder is not None:
        sets["sketches"] = [sketch_trial(name, folder / "sketches") for name in SKETCHES]
    return sets


WALLED_UP = Wall(points=((2.4, 10.4), (3.6, 10.4)))  # the door of the upper left room


def _with_extra_door() -> WorldConfig:
    """The building with a door in the wall between the two upper rooms."""
    world, _ = load_world("hand-building")
    walls = [w for w in world.walls if w.points != ((7.0, 10.4), (7.0, 17.0))]
    halves = (Wall(points=((7.0, 10.4), (7.0, 13.0))), Wall(points=((7.0, 14.2), (7.0, 17.0))))
    return world.model_copy(update={"walls": (*walls, *halves)})


SKETCHES = {
    # drawing: plan, its metres a pixel, start in the world (m, deg), start in the drawing (drawing units)
    "kth_04": ("kth_model", 0.05, (12.5, 10.0, 0.0), (23.2, 18.3, 0.0)),
    "kth_07": ("kth_model", 0.05, (12.5, 10.0, 0.0), (24.0, 22.0, 0.0)),
    "kth_10": ("kth_model", 0.05, (12.5, 10.0, 0.0), (19.5, 8.8, 0.0)),
    "kth_13": ("kth_model", 0.05, (12.5, 10.0, 0.0), (23.3, 40.8, 0.0)),
    "easy_01": ("easy_model", 0.05, (11.0, 3.0, 0.0), (15.0, 9.5, 0.0)),
    "easy_05": ("easy_model", 0.05, (11.0, 3.0, 0.0), (14.6, 10.0, 0.0)),
    "easy_08": ("easy_model", 0.05, (11.0, 3.0, 0.0), (21.5, 6.4, 0.0)),
    "corridor_1": ("corridor_model", 0.08, (44.0, 17.2, 0.0), (75.0, 40.0, 0.0)),
}


def sketch_trial(drawing: str, folder: Path) -> ExplorationTrial:
    """The place of a person's drawing in the folder of the sketches."""
    plan, resolution_m, start, start_drawn = SKETCHES[drawing]
    building, _ = load_world("hand-corridor-25")
    document = {
        "plan": {"file": str((folder / f"{plan}.png").resolve()), "resolution_m": resolution_m, "walls_are": "bright"},
        "robot": {"start": list(start), "wheels": building.robot.wheels.model_dump()},
        "sensors": building.sensors.model_dump(exclude_none=True),
    }  # fmt: skip
    world = validate_world(document, plan)
    return ExplorationTrial(
        drawing, world, folder / f"{drawing}.png", start_drawn, tuple(range(5)), folder=folder
    )


def table(results: Iterable[ExplorationResult]) -> str:
    """One line per trial: runs finished, contacts, and the means of the figures with the worst map error."""
    by_name: dict[str, list[ExplorationResult]] = {}
    for result in results:
        by_name.setdefault(result.trial, []).append(result)
    head = (
        "trial                            runs fin con unre  map mean/worst (m)  compl (m)  cover"
        "  s_x    s_y    time s  dist m  cpu s"
    )
    lines = [head]
    for name, runs in by_name.items():
        mean = {
            key: float(np.nanmean([getattr(r, key) for r in runs]))
            for key in ("map_error_m", "completeness_m", "coverage", "duration_s", "travelled_m", "cpu_s", "scale_x", "scale_y")
        }  # fmt: skip
        worst = max(r.map_error_m for r in runs)
        finished, contacts = (sum(r.ended == how for r in runs) for how in ("finished", "contact"))
        lines.append(
            f"{name:32} {len(runs):4d} {finished:3d} {contacts:3d} {sum(r.unreachable for r in runs):4d}"
            f"  {mean['map_error_m']:8.3f} / {worst:.3f}    {mean['completeness_m']:6.3f}    {mean['coverage']:.3f}"
            f"  {mean['scale_x']:.3f}  {mean['scale_y']:.3f}  {mean['duration_s']:6.0f}"
            f" {mean['travelled_m']:6.0f} {mean['cpu_s']:6.1f}"
        )
    return "\n".join(lines)


def draw_bars(results: Iterable[ExplorationResult], path: Path) -> None:
    """Mean distance of the maps by ratio, with and without motion correction, as figure 10 has it; whiskers: range of the seeds.

    A panel for each kind of `corridor_trials` among the runs.
    """
    from matplotlib.figure import Figure

    by_name: dict[tuple[str, int, str], list[float]] = {}
    for run in results:
        _, length, *words, how = run.trial.split("-")
        by_name.setdefault(("-".join(words), int(length), how), []).append(run.mean_distance_m)
    kinds = list(dict.fromkeys(kind for kind, _, _ in by_name))
    figure = Figure(figsize=(1.6 + 3.6 * len(kinds), 3.2), layout="constrained")
    every = figure.subplots(1, len(kinds), squeeze=False)[0]
    for axes, kind in zip(every, kinds, strict=True):
        for shift, how, ink in ((-0.2, "corrected", "#1e6ec8"), (0.2, "uncorrected", "#c8c8c8")):
            errors = [by_name.get((kind, m, how), [float("nan")]) for m in LENGTHS_M]
            means = [float(np.mean(e)) for e in errors]
            below = [mean - min(e) for mean, e in zip(means, errors, strict=True)]
            above = [max(e) - mean for mean, e in zip(means, errors, strict=True)]
            axes.bar(np.arange(4) + shift, means, 0.38, yerr=[below, above], label=how, color=ink, capsize=3)
        axes.set_xticks(range(4), [f"{m / DRAWN_M:g}" for m in LENGTHS_M])
        axes.set_title(KIND_TITLES[kind], fontsize=10)
        axes.axhline(0.05, color="#cd2d2d", linewidth=1.0, linestyle="--")
    every[0].set_ylabel("mean distance between the maps (m)")
    every[-1].legend(frameon=False, loc="upper left")
    figure.supxlabel("length of the corridor over the length drawn", fontsize=10)
    figure.savefig(path, dpi=110)


def run_set(
    chosen: Iterable[ExplorationTrial], folder: Path, max_seeds: int | None = None
) -> list[ExplorationResult]:
    """All runs of some trials; each is stored in `runs.jsonl`, and runs found there are not repeated."""
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "runs.jsonl"
    lines = record.read_text().splitlines() if record.exists() else []
    known = {(o.trial, o.seed): o for o in (ExplorationResult(**json.loads(line)) for line in lines)}
    found = []
    for trial in chosen:
        for seed in trial.seeds[:max_seeds]:
            result = known.get((trial.name, seed))
            if result is None:
                result = run_trial(trial, seed, folder)
                with record.open("a") as stream:
                    stream.write(
                        json.dumps({k: getattr(result, k) for k in ExplorationResult.__dataclass_fields__})
                        + "\n"
                    )
            say(f"{trial.name} {seed}: {result.ended}, map {result.map_error_m:.3f} m, {result.reasons}")
            found.append(result)
    return found


if __name__ == "__main__":
    every, bars = trials(), []
    for name in sys.argv[2:] or every:
        wanted, _, max_seeds = name.partition(":")
        found = run_set(every[wanted], Path(sys.argv[1]), int(max_seeds) if max_seeds else None)
        print(f"\n{wanted}\n{table(found)}", flush=True)  # noqa: T201
        if wanted.startswith("corridors"):
            bars += found
            draw_bars(bars, Path(sys.argv[1]) / "corridors.png")
