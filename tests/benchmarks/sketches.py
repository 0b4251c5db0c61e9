"""People's drawings of three places: recorded drives and explorations, figures and pictures of each on one page to be looked at.

`python -m tests.benchmarks.sketches OUT [SEEDS]` writes OUT/sketches.md with its pictures. Runs that OUT has already are not
repeated. Where a drawing resembles its place enough for corners to be named in both, the fraction of the poses within a metre of
where the robot was is given, of those near a corner: the correspondence is a thin plate spline through these corners, set by
eye to some decimetres, and between them a drawing does not say where a place is.
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
from scipy.spatial.distance import cdist

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
NAMED_M = 3.0  # poses this close to a named corner are judged
PICTURES = ("warp", "exploration", "drawing")
PICTURE_PX = 900

# Corners in the plan and in the drawing, and places opposite to them on straight outer walls; pixels from the top left of each.
CORNERS = {
    "kth_04": """121 58 72 90, 220 58 133 91, 220 15 138 54, 320 15 322 57, 320 46 320 86, 312 46 304 86, 312 89 304 133,
        358 89 358 133, 358 78 359 122, 373 78 371 122, 373 15 371 54, 415 15 419 56, 415 196 413 170, 428 196 429 172,
        428 273 432 258, 416 273 415 261, 397 267 403 265, 397 321 405 310, 416 357 416 323, 379 357 396 323,
        150 138 84 212, 165 138 103 212, 165 267 104 307, 121 230 73 293, 150 286 84 340""",
    "kth_10": """121 58 22 36, 220 58 154 35, 220 15 155 10, 320 15 281 8, 320 46 284 23, 312 46 264 23, 312 89 268 92,
        358 89 360 95, 358 78 356 67, 373 78 386 63, 373 15 386 10, 415 15 459 8, 415 196 460 153, 428 196 478 154,
        428 273 483 205, 416 273 460 208, 397 267 390 195, 397 321 387 197, 379 321 373 198, 379 357 377 262,
        416 357 460 258, 150 138 84 136, 165 138 105 137, 165 267 106 253, 107 230 18 147, 107 247 15 183,
        121 230 34 142, 121 247 30 186, 121 262 30 250, 130 249 40 200, 145 249 69 198, 150 286 81 251""",
    "kth_13": """121 58 53 183, 220 58 190 200, 220 15 210 155, 320 15 307 163, 320 46 302 238, 312 46 275 240, 312 89 276 340,
        358 89 358 342, 358 78 366 264, 373 78 406 258, 373 15 418 154, 415 15 452 153, 415 196 450 498,
        428 196 476 502, 428 273 484 616, 416 273 450 626, 397 267 358 697, 397 321 360 742, 379 321 320 748,
        379 357 322 860, 416 357 446 845, 150 138 113 409, 165 138 131 409, 165 267 140 705, 107 230 5 752,
        107 247 6 780, 121 230 30 745, 121 247 23 795, 121 262 24 870, 130 249 52 808, 145 249 85 806, 150 286 120 872""",
    "easy_05": """12 14 5 5, 622 14 495 5, 12 380 5 495, 622 380 495 495, 135 285 97 308, 145 133 107 145, 145 113 103 123,
        432 115 358 142, 413 133 341 162, 432 288 373 315, 413 270 351 295, 300 279 190 300, 125 14 75 5, 143 14 105 5,
        135 380 97 495, 300 380 190 495, 432 380 373 495, 432 14 358 5, 622 115 495 142, 622 288 495 315, 12 285 5 308,
        12 123 5 134""",
    "easy_08": """622 14 495 5, 12 380 5 495, 622 380 495 495, 135 285 168 378, 145 133 158 192, 432 115 335 182,
        413 133 318 195, 422 288 337 378, 125 14 5 173, 143 14 5 150, 135 380 168 495, 422 380 337 495, 432 14 335 5,
        622 115 495 182, 622 288 495 378""",
    "corridor_1": """12 370 98 453, 980 372 1310 428, 462 112 645 125, 420 70 603 92, 400 218 586 256, 440 218 629 248,
        262 120 378 137, 385 120 538 135, 262 228 381 275, 468 182 712 192, 492 182 737 188, 735 180 1018 185,
        792 180 1072 197, 855 180 1143 195, 804 180 1117 197, 918 95 1180 70, 980 95 1240 75, 980 218 1240 240,
        248 247 377 302, 380 247 527 302, 248 340 365 420, 380 340 522 400, 162 228 282 312, 238 228 325 305,
        162 335 268 415, 238 335 337 415, 154 335 232 413, 82 360 150 418, 12 228 98 325, 388 340 566 402,
        460 340 650 405, 918 340 1250 372, 918 232 1258 215, 980 232 1290 215, 778 345 1100 370, 848 345 1175 370""",
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
    """The fraction of poses near corners within `NEAR_M` of where the robot was, mapped by these corners; NaN without them."""
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
    is_judged = cdist(true[:, :2], place).min(axis=1) < NAMED_M
    errors = np.hypot(*((estimates - to_drawing(true[:, :2])) / scales).T)
    return float((errors < NEAR_M)[is_judged].mean())


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
