"""People's drawings of three places: recorded drives and explorations, figures and pictures of each on one page to be looked at.

`python -m tests.benchmarks.sketches OUT [SEEDS]` writes OUT/sketches.md with its pictures. Runs that OUT has already are not
repeated. Where a drawing resembles its place enough for corners to be named in both, the fraction of the poses within a metre of
where the robot was is given; the correspondence is a thin plate spline through these corners, set by eye to some decimetres.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.interpolate import RBFInterpolator

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.association import associate
from gridslam.evaluation.map_errors import wall_distances
from gridslam.maps.drawings.drawing import load_drawing
from gridslam.maps.map_server import load_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.method import HandmapSlam
from gridslam.runs.explore import explore
from gridslam.runs.inputs import read_inputs
from gridslam.runs.run_config import load_config
from tests.benchmarks.drawn_places import sketched_drive
from tests.benchmarks.explorations import SKETCHES, coverage_of, sketch_trial
from tests.benchmarks.harness import say
from tests.benchmarks.real_places import data_dir

Floats = NDArray[np.float64]

NEAR_M = 1.0
PICTURES = ("warp", "exploration", "drawing")
PICTURE_PX = 900

# Corners in the plan and in the drawing, pixels from the top left of each.
CORNERS = {
    "kth_04": """120 60 75 90, 220 60 133 90, 220 15 137 55, 318 15 322 57, 315 90 305 133, 360 90 358 133, 375 78 370 122,
        375 15 372 55, 418 15 418 55, 418 197 413 172, 430 197 430 173, 430 275 432 258, 418 275 414 262, 150 138 85 213,
        165 138 103 213, 165 268 105 308""",
    "kth_10": """120 60 25 37, 220 60 152 36, 220 15 157 10, 318 15 283 10, 315 90 270 92, 360 90 352 97, 375 78 360 68,
        375 15 387 10, 418 15 460 8, 418 197 460 153, 430 197 478 153, 430 275 483 205, 418 275 461 208, 150 138 85 135,
        165 138 107 135, 165 268 107 254""",
    "kth_13": """120 60 55 183, 207 60 190 200, 220 15 212 155, 318 15 306 163, 315 90 275 340, 360 90 357 342, 375 78 366 265,
        375 15 418 155, 418 15 452 155, 418 197 450 498, 430 197 475 503, 430 275 483 615, 418 275 452 628, 150 138 113 410,
        165 138 130 410, 165 268 145 705, 398 268 355 698""",
    "easy_05": """12 14 5 5, 622 14 495 5, 12 380 5 495, 622 380 495 495, 135 285 97 308, 145 133 107 145, 145 113 103 123,
        432 115 358 142, 413 133 341 162, 432 288 373 315, 413 270 351 295, 300 279 190 300, 125 14 75 5""",
    "easy_08": """622 14 495 5, 12 380 5 495, 622 380 495 495, 135 285 168 378, 145 133 158 192, 432 115 335 182,
        413 133 318 195, 422 288 337 378""",
}


@dataclass(frozen=True, slots=True)
class SketchRun:
    """A run: errors in metres, fractions, and the run's status (`ended` of an exploration if that did not finish)."""

    sketch: str
    kind: str
    seed: int
    status: str
    map_error_m: float
    coverage: float
    within_1m: float
    doubtful: float


def recorded(sketch: str, folder: Path, seed: int, out: Path) -> SketchRun:
    """Map a recorded round through the place."""
    plan, resolution_m, start, start_drawn = SKETCHES[sketch]
    plan_path = folder / f"{plan}.png"
    rows = load_drawing(plan_path).levels.shape[0]
    drive = sketched_drive(
        plan_path, (start[0] / resolution_m, rows - start[1] / resolution_m), resolution_m, seed
    )
    drawing = load_drawing(folder / f"{sketch}.png")
    method = HandmapSlam(HandmapSlamConfig(start=start_drawn), seed, drawing=drawing)
    for event in drive.events:
        method.process(event)
    return _judged(sketch, "recorded", seed, method.result(), drive.truth, drive.grid, folder, out)


def explored(sketch: str, folder: Path, seed: int, out: Path) -> SketchRun:
    """Let the robot explore the place."""
    trial = sketch_trial(sketch, folder)
    world = trial.world.model_copy(update={"seed": seed})  # type: ignore[union-attr]
    start = ", ".join(str(v) for v in trial.start)
    config = load_config(trial.config, [f"method.start=[{start}]"], seed)
    inputs = read_inputs({"drawing": trial.drawing}, "handmap-slam")
    with tempfile.TemporaryDirectory() as name:
        done = explore(config, world, trial.drawing, inputs, Path(name), lambda _: None, lambda: False)
        assert done.run.truth is not None
        grid = load_map(Path(name) / "truth" / "map.yaml")
        kind = "explored" if done.ended == "finished" else done.ended
        return _judged(sketch, kind, seed, done.run.result, done.run.truth, grid, folder, out)


def _judged(
    sketch: str,
    kind: str,
    seed: int,
    result: RunResult,
    truth: Trajectory,
    grid: OccupancyGrid,
    folder: Path,
    out: Path,
) -> SketchRun:
    """Judge a run, and save its pictures."""
    built = result.occupancy
    assert built is not None
    pairs = associate(result.trajectory.sorted(), truth.sorted(), "interpolate", 200_000_000)
    alignment = find_alignment(pairs.estimate, pairs.truth, "se2", False)
    assert alignment is not None
    for name in PICTURES:
        if name in result.pictures:
            picture = Image.fromarray(result.pictures[name].rgb)
            picture.thumbnail((PICTURE_PX, PICTURE_PX))
            picture.save(out / f"{sketch}-{kind}-{seed}-{name}.png")
    drawing = result.measures["drawing"]
    assert isinstance(drawing, dict)
    return SketchRun(
        sketch, kind, seed, result.doubt.status if result.doubt else "complete",
        map_error_m=float(wall_distances(built, grid, alignment.T_truth_estimate).accuracy.mean()),
        coverage=coverage_of(built, grid, alignment.T_truth_estimate, truth),
        within_1m=_within(sketch, result, truth, folder),
        doubtful=float(drawing["warp"]["doubtful_fraction"]),
    )  # fmt: skip


def _within(sketch: str, result: RunResult, truth: Trajectory, folder: Path) -> float:
    """The fraction of poses within `NEAR_M` of where the robot was, mapped by the corners; NaN without them."""
    if sketch not in CORNERS:
        return float("nan")
    plan, resolution_m, *_ = SKETCHES[sketch]
    corners = np.array([[float(v) for v in pair.split()] for pair in CORNERS[sketch].split(",")])
    heights = [load_drawing(folder / f"{name}.png").levels.shape[0] for name in (plan, sketch)]
    place = np.column_stack([corners[:, 0], heights[0] - corners[:, 1]]) * resolution_m
    drawn = np.column_stack([corners[:, 2], heights[1] - corners[:, 3]]) * 0.1
    to_drawing = RBFInterpolator(place, drawn, kernel="thin_plate_spline", smoothing=0.05)
    columns = result.tables["drawing_path"].columns
    table = [dict(zip(columns, row, strict=True)) for row in result.tables["drawing_path"].rows]
    true, _ = truth.sorted().at(result.trajectory.stamps_ns)
    estimates = np.array([(row["x"], row["y"]) for row in table], np.float64)
    scales = np.array([(row["scale_x"], row["scale_y"]) for row in table], np.float64)
    return float((np.hypot(*((estimates - to_drawing(true[:, :2])) / scales).T) < NEAR_M).mean())


def page(runs: list[SketchRun], pictures: Path) -> Iterator[str]:
    """The lines of the page."""
    yield "# People's drawings\n\nThe lowest coverage and the lowest fraction within 1 m of all seeds.\n"
    yield "| drawing | drive | seeds | map error, m (worst) | coverage | within 1 m | doubtful (most) | not complete |"
    yield "| --- " * 8 + "|"
    keys = list(dict.fromkeys((run.sketch, run.kind) for run in runs))
    for sketch, kind in keys:
        mine = [run for run in runs if (run.sketch, run.kind) == (sketch, kind)]
        within = "-" if np.isnan(mine[0].within_1m) else f"{min(r.within_1m for r in mine):.1%}"
        others = sum(r.status != "complete" for r in mine)
        yield (
            f"| {sketch} | {kind} | {len(mine)} | {max(r.map_error_m for r in mine):.3f} | {min(r.coverage for r in mine):.1%} "
            f"| {within} | {max(r.doubtful for r in mine):.0%} | {others} |"
        )
    for sketch, kind in keys:
        seed = next(run.seed for run in runs if (run.sketch, run.kind) == (sketch, kind))
        yield f"\n## {sketch}, {kind}\n"
        for name in PICTURES[:2]:
            file = f"{sketch}-{kind}-{seed}-{name}.png"
            if (pictures / file).exists():
                yield f"![{sketch}, {kind}: {name}]({file})\n"


def main() -> None:
    """Make all runs that are not there, and the page."""
    out, seeds = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 5
    folder = data_dir()
    if folder is None:
        say("no data: GRIDSLAM_DATA")
        return
    out.mkdir(parents=True, exist_ok=True)
    record = out / "runs.jsonl"
    lines = record.read_text().splitlines() if record.exists() else []
    runs = [SketchRun(**json.loads(line)) for line in lines]
    for seed in range(seeds):
        for sketch in SKETCHES:
            for make, is_recorded in ((recorded, True), (explored, False)):
                if any((r.sketch, r.seed, r.kind == "recorded") == (sketch, seed, is_recorded) for r in runs):
                    continue
                run = make(sketch, folder / "sketches", seed, out)
                say(str(run))
                runs.append(run)
                with record.open("a") as stream:
                    stream.write(json.dumps(asdict(run)) + "\n")
                (out / "sketches.md").write_text("\n".join(page(runs, out)) + "\n")


if __name__ == "__main__":
    main()
