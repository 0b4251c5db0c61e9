"""Global localization in Wean Hall: 20 seeds on each log, and a picture of the first.

There is no reference; a seed has converged when its path ends on that of the majority and its scans agree with the walls.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Transform
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.wean import load_wean_map
from gridslam.methods.base import RunResult
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.sensors.lidar_beams import beams_of, extrinsics_of
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir, events_of

SEEDS = range(20)
PICTURES = Path("out") / "benchmarks"


def rows() -> Iterator[BenchmarkRow]:
    """Converged seeds of 20, the worst mean distance of endpoints to walls after a third of the log, and the time to it."""
    folder = data_dir()
    if folder is None:
        return
    grid = load_wean_map(folder / "wean_hall" / "wean.dat.gz")
    for log in sorted((folder / "wean_hall").glob("robotdata*.log.gz")):
        name = log.name.split(".")[0]
        events = events_of(log)
        results = [localized(events, grid, seed) for seed in SEEDS]
        paths = np.array([result.trajectory.poses for result in results])
        common = paths[medoid(paths)]
        away = np.hypot(paths[..., 0] - common[:, 0], paths[..., 1] - common[:, 1])
        distances = [late_wall_distance(result) for result in results]
        found = sum(bool((a[-10:] < 0.5).all() and d <= 0.15) for a, d in zip(away, distances, strict=True))
        stamps = results[0].trajectory.stamps_ns
        waits = [seconds_until_held(a, stamps) for a in away]
        say(f"{name}: seeds on the common path after s: {np.round(waits, 1).tolist()}")
        say(
            f"{name}: fraction of poses on the common path: {np.round((away < 0.5).mean(axis=1), 3).tolist()}"
        )
        yield BenchmarkRow(f"localize.{name}.found", found, f"of {len(SEEDS)}", len(SEEDS), at_least=True)
        yield BenchmarkRow(f"localize.{name}.wall_distance", max(distances), "m", 0.15)
        yield BenchmarkRow(
            f"localize.{name}.first_localized", float(np.median([localized_after(r) for r in results])), "s"
        )
        jumping = sum(jumps(result) > 0 for result in results)
        yield BenchmarkRow(f"localize.{name}.leaping", jumping, f"of {len(SEEDS)}", 1.0)
        say(f"picture: {draw(grid, events, results[0], PICTURES / f'wean_{name}.png')}")


def localized(events: list[Event], grid: OccupancyGrid, seed: int) -> RunResult:
    """One run without a start pose."""
    method = IspaceMcl(IspaceMclConfig(), seed, grid)
    for event in events:
        method.process(event)
    return method.result()


def medoid(paths: NDArray[np.float64]) -> int:
    """Index of the path that has most poses in common with the others."""
    near = [(np.hypot(*(paths - path).transpose(2, 0, 1)[:2]) < 0.5).mean() for path in paths]
    return int(np.argmax(near))


def late_wall_distance(result: RunResult) -> float:
    """Mean distance (m) of endpoints to walls after the first third of the log."""
    values = result.series["wall_distance"].values
    return float(np.nanmean(values[len(values) // 3 :]))


def localized_after(result: RunResult) -> float:
    """Time (s) until the first localized pose."""
    facts = result.measures["localization"]
    assert isinstance(facts, dict)
    seconds = facts["localized_after_s"]
    return float("nan") if seconds is None else float(seconds)


def jumps(result: RunResult) -> int:
    """Number of steps of more than a metre between consecutive scans after the first ten seconds."""
    path = result.trajectory
    late = path.stamps_ns[1:] - path.stamps_ns[0] > 10 * 10**9
    steps = np.hypot(*np.diff(path.poses[:, :2], axis=0).T)
    return int((late & (steps > 1.0)).sum())


def seconds_until_held(away: NDArray[np.float64], stamps: NDArray[np.int64]) -> float:
    """Time (s) after which the path remains on the common one."""
    off = np.flatnonzero(away > 0.5)
    return float((stamps[off[-1]] - stamps[0]) * 1e-9) if len(off) else 0.0


def draw(grid: OccupancyGrid, events: list[Event], result: RunResult, path: Path) -> Path:
    """Map, path coloured by confidence, and the endpoints of every sixth scan."""
    poses = dict(zip(result.trajectory.stamps_ns.tolist(), result.trajectory.poses, strict=True))
    (extrinsics,) = [extrinsics_of(event) for event in events if isinstance(event, Transform)]
    scans = [event for event in events if isinstance(event, LaserScan)][::6]
    points = np.concatenate(
        [se2.transform_points(poses[s.stamp_ns], beams_of(s, extrinsics, 0.1, 20.0).points) for s in scans]
    )
    known = np.argwhere(~np.isnan(grid.probability)) * grid.geometry.resolution_m
    (bottom, left), (top, right) = known.min(axis=0), known.max(axis=0)
    figure = Figure(figsize=(12.0, 9.0), layout="constrained")
    axes = figure.add_subplot()
    rows_m, cols_m = (n * grid.geometry.resolution_m for n in grid.probability.shape)
    axes.imshow(
        1.0 - np.nan_to_num(grid.probability, nan=0.5), "gray", origin="lower", extent=(0, cols_m, 0, rows_m)
    )
    axes.plot(points[:, 0], points[:, 1], "r,", alpha=0.6)
    xy, confidence = result.trajectory.poses, result.series["confidence"].values
    dots = axes.scatter(xy[:, 0], xy[:, 1], c=confidence, s=4, vmin=0.0, vmax=1.0)
    figure.colorbar(dots, label="confidence", shrink=0.6)
    axes.set(xlim=(left, right), ylim=(bottom, top), xlabel="x (m)", ylabel="y (m)")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    return path
