"""handmap-slam over recorded drives: map error, localization in the drawing, scales, with and without motion correction.

The drives are those of the simulator's driver, so the map is evaluated and not the exploration. The map error is the mean
distance from mapped walls to the nearest true wall. All bounds are on the worst seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from PIL import Image

from gridslam.maps.drawings.drawing import Drawing, load_drawing
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from tests.benchmarks.drawn_places import (
    DRAWINGS,
    JudgedPlace,
    built_in_drive,
    free_fraction,
    in_distorted_building,
    judge,
    return_error_m,
    sketched_drive,
)
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir

SEEDS = range(10)
FEW_SEEDS = range(5)  # of slow runs without a bound
SKETCH_SEEDS = range(3)
PICTURES = Path("out") / "benchmarks"
CORRIDOR_START = (2.7, 3.2, 0.0)
BUILDING_START = (2.4, 10.4, 0.0)
CURVED_START = (2.3, 2.25, 0.0)
ROUND_START = (2.4, 8.0, 0.0)
DISTORTED_START = (2.5, 9.2, 0.0)
STRETCHES = ((0.6, 0.6), (1.5, 1.5), (1.25, 0.9), (0.8, 1.1))

# Sketch: its plan, metres a pixel of the plan, the start in plan and sketch (pixels from the top left).
SKETCHES: dict[str, tuple[str, float, tuple[float, float], tuple[float, float]]] = {
    "corridor_1": ("corridor_model", 0.05, (60, 350), (158, 430)),
    "kth_04": ("kth_model", 0.05, (250, 170), (210, 232)),
    "kth_10": ("kth_model", 0.05, (250, 170), (175, 165)),
    "kth_13": ("kth_model", 0.05, (250, 170), (240, 490)),
    "easy_01": ("easy_model", 0.05, (60, 330), (47, 412)),
    "easy_05": ("easy_model", 0.05, (60, 330), (47, 412)),
}
SKETCH_SETTINGS = {"aspect_std": 0.4}  # people do not preserve the ratio of width to height


def rows() -> Iterator[BenchmarkRow]:
    """All figures."""
    yield from corridor_rows()
    yield from building_rows()
    yield from curved_rows()
    yield from stretched_rows()
    folder = data_dir()
    if folder is not None:
        yield from sketch_rows(folder / "sketches")


def paper_settings() -> dict[str, Any]:
    """The settings of configs/paper/handmap-slam.yaml."""
    text = (DRAWINGS.parents[1] / "paper" / "handmap-slam.yaml").read_text()
    return dict(yaml.safe_load(text)["method"])


def corridor_rows() -> Iterator[BenchmarkRow]:
    """Corridors of four lengths, one drawing; best settings and the paper's, with and without correction."""
    drawing = load_drawing(DRAWINGS / "corridor.png")
    kinds: dict[str, dict[str, Any]] = {
        "best": {},
        "paper": paper_settings(),
        "paper.uncorrected": {**paper_settings(), "correction": False},
    }
    for length in (20, 25, 30, 35):
        for kind, settings in kinds.items():
            config = HandmapSlamConfig(**{**settings, "start": CORRIDOR_START})
            seeds = SEEDS if kind == "best" else FEW_SEEDS
            runs = [judge(built_in_drive(f"hand-corridor-{length}", s), config, drawing, s) for s in seeds]
            stretch = np.array([25.0 / length, 1.0])
            errors = [r.drawing_errors(r.true_poses[:, :2] * stretch + 1.2) for r in runs]
            label = f"handmap.corridor-{length}.{kind}"
            yield from summary(label, runs, 0.05 if kind == "best" else None)
            yield BenchmarkRow(f"{label}.in_drawing", max(float(e.mean()) for e in errors), "drawing units")
            yield BenchmarkRow(f"{label}.inlier_ratio", min(fact(r, "inlier_ratio") for r in runs), "ratio")
            yield BenchmarkRow(f"{label}.x_observed", min(x_observed(r) for r in runs), "fraction of updates")
            if kind == "best":
                yield BenchmarkRow(
                    f"{label}.scale_x", worst_scale(runs, "scale_x", 25.0 / length), "relative", 0.05
                )
                yield BenchmarkRow(
                    f"{label}.cpu", 1e3 * max(r.cpu_per_scan_s for r in runs), "ms a scan", 10.0
                )


def building_rows() -> Iterator[BenchmarkRow]:
    """The building with both drawings, start given and found."""
    for name, start in (("building", BUILDING_START), ("building-distorted", DISTORTED_START)):
        drawing = load_drawing(DRAWINGS / f"{name}.png")
        for kind, start_pose in (("", start), (".found", None)):
            config = HandmapSlamConfig(start=start_pose)
            runs = [judge(built_in_drive("hand-building", seed), config, drawing, seed) for seed in SEEDS]
            label = f"handmap.{name}{kind}"
            yield from summary(label, runs)
            if name == "building":
                expected = [r.true_poses[:, :2] + 1.2 for r in runs]
            else:
                expected = [in_distorted_building(r.true_poses[:, :2]) for r in runs]
            errors = [r.drawing_errors(w) for r, w in zip(runs, expected, strict=True)]
            yield BenchmarkRow(
                f"{label}.in_drawing", max(float(e.mean()) for e in errors), "drawing units", 1.0
            )
            yield BenchmarkRow(
                f"{label}.within_1m",
                min(float((e < 1.0).mean()) for e in errors),
                "fraction",
                0.7,
                at_least=True,
            )
            if name == "building":
                yield BenchmarkRow(f"{label}.scale", worst_scale(runs, "scale", 1.0), "relative", 0.05)
            save_picture(runs[0], f"handmap_{name}{kind}")


def curved_rows() -> Iterator[BenchmarkRow]:
    """An S-shaped corridor and a round hall, which have no straight lines."""
    for name, start in (("curved", CURVED_START), ("round", ROUND_START)):
        drawing = load_drawing(DRAWINGS / f"{name}.png")
        for kind, settings, seeds in (("best", {}, SEEDS), ("paper", paper_settings(), FEW_SEEDS)):
            config = HandmapSlamConfig(**{**settings, "start": start})
            runs = [judge(built_in_drive(f"hand-{name}", seed), config, drawing, seed) for seed in seeds]
            yield from summary(f"handmap.{name}.{kind}", runs, 0.08 if kind == "best" else None)
            if kind == "best":
                yield BenchmarkRow(
                    f"handmap.{name}.inlier_ratio",
                    min(fact(r, "inlier_ratio") for r in runs),
                    "ratio",
                    0.7,
                    at_least=True,
                )
                save_picture(runs[0], f"handmap_{name}")


def stretched_rows() -> Iterator[BenchmarkRow]:
    """The building's drawing stretched along its axes: both scales."""
    plain = load_drawing(DRAWINGS / "building.png")
    for scale_x, scale_y in STRETCHES:
        height, width = plain.levels.shape
        size = (round(width * scale_x), round(height * scale_y))
        drawing = Drawing(cv2.resize(plain.levels, size, interpolation=cv2.INTER_AREA), "stretched")
        x, y, yaw = BUILDING_START
        config = HandmapSlamConfig(start=(x * scale_x, y * scale_y, yaw))
        runs = [judge(built_in_drive("hand-building", seed), config, drawing, seed) for seed in FEW_SEEDS]
        label = f"handmap.stretched-{scale_x:g}-{scale_y:g}"
        yield BenchmarkRow(f"{label}.scale_x", worst_scale(runs, "scale_x", scale_x), "relative", 0.05)
        yield BenchmarkRow(f"{label}.scale_y", worst_scale(runs, "scale_y", scale_y), "relative", 0.05)


def sketch_rows(folder: Path) -> Iterator[BenchmarkRow]:
    """Drawings by people; the true plan serves as the place."""
    for name, (plan, resolution, world_start, start_px) in SKETCHES.items():
        drawing = load_drawing(folder / f"{name}.png")
        height = drawing.levels.shape[0]
        start = (0.1 * start_px[0], 0.1 * (height - start_px[1]))
        config = HandmapSlamConfig(start=(*start, 0.0), advanced=SKETCH_SETTINGS)
        runs = [
            judge(
                sketched_drive(folder / f"{plan}.png", world_start, resolution, seed), config, drawing, seed
            )
            for seed in SKETCH_SEEDS
        ]
        label = f"handmap.sketch.{name}"
        yield from summary(label, runs)
        yield BenchmarkRow(f"{label}.inlier_ratio", min(fact(r, "inlier_ratio") for r in runs), "ratio")
        yield BenchmarkRow(f"{label}.coverage", min(fact(r, "coverage") for r in runs), "fraction")
        yield BenchmarkRow(
            f"{label}.in_free", min(free_fraction(r, drawing, start) for r in runs), "fraction"
        )
        yield BenchmarkRow(f"{label}.return", max(return_error_m(r) for r in runs), "m")
        save_picture(runs[0], f"handmap_{name}")


def summary(label: str, runs: list[JudgedPlace], bound: float | None = 0.05) -> Iterator[BenchmarkRow]:
    """Map error: worst and mean of the seeds."""
    map_errors = [r.map_error_m for r in runs]
    say(f"{label}: map error by seed {np.round(map_errors, 4).tolist()}")
    yield BenchmarkRow(f"{label}.map", max(map_errors), "m", bound)
    yield BenchmarkRow(f"{label}.map_mean", float(np.mean(map_errors)), "m")


def fact(run: JudgedPlace, key: str) -> float:
    """A number of the report's measures of the drawing."""
    facts = run.result.measures["drawing"]
    assert isinstance(facts, dict)
    return float(facts[key])


def x_observed(run: JudgedPlace) -> float:
    """Fraction of the updates with drawn lines across x in view at which one of them was observed."""
    seen, unseen = (run.result.counters.get(f"lines.x.{k}", 0) for k in ("observed", "unobserved"))
    return seen / max(seen + unseen, 1)


def worst_scale(runs: list[JudgedPlace], key: str, expected: float) -> float:
    """Largest relative error of a scale over the seeds."""
    return max(abs(fact(r, key) / expected - 1.0) for r in runs)


def save_picture(run: JudgedPlace, name: str) -> None:
    """Save the picture of a run."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    Image.fromarray(run.result.pictures["drawing"].rgb).save(PICTURES / f"{name}.png")
