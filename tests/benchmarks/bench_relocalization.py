"""Global localization, and recovery from a wrong start pose, on real logs.

From 20 places along a log the robot drives 15 m. It has succeeded when it was within 0.5 m and 10 degrees of the reference over
all of the last 3 m. Kidnapped: the start pose is more than 5 m off, with standard deviations of 0.1 m and 0.05 rad. In the crowd
half of all beams end at people.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Transform, readonly
from gridslam.filters.free_space import draw_free_poses, free_cells
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from tests.benchmarks.harness import Row, say
from tests.benchmarks.real_places import Place, data_dir, place

STARTS = 20
TRAVEL_M = 15.0
HELD_M = 3.0
CROWD_RATIO = 0.5
MIN_FOUND = {"global": 20, "kidnapped": 18, "global-crowd": 18, "kidnapped-crowd": 18}


@dataclass(frozen=True, slots=True)
class DriveResult:
    """Whether the robot was found, and the travel (m) after which it remained found."""

    found: bool
    converged_m: float


def rows() -> Iterator[Row]:
    """Successes of 20 and the median travel to convergence, for every log and task."""
    folder = data_dir()
    if folder is None:
        return
    for name in ("aces", "mit-csail"):
        here = place(folder, name)
        for task in MIN_FOUND:
            results = [trial(here, task, start, seed=start) for start in range(STARTS)]
            failed = [start for start, result in enumerate(results) if not result.found]
            say(f"{name} {task}: failed from {failed or 'nowhere'}")
            label = f"localize.{name}.{task}"
            yield Row(f"{label}.found", STARTS - len(failed), f"of {STARTS}", MIN_FOUND[task], at_least=True)
            yield Row(f"{label}.converged", float(np.median([r.converged_m for r in results])), "m")


def trial(here: Place, task: str, start: int, seed: int) -> DriveResult:
    """One drive from one of the starts."""
    travel = np.r_[0.0, np.cumsum(np.hypot(*np.diff(here.poses[:, :2], axis=0).T))]
    first = int(np.searchsorted(travel, start * (travel[-1] - TRAVEL_M - 1.0) / (STARTS - 1)))
    last = int(np.searchsorted(travel, travel[first] + TRAVEL_M))
    rng = np.random.default_rng(seed)
    start_ns, end_ns = int(here.stamps_ns[first]), int(here.stamps_ns[last])
    events = [e for e in here.events if isinstance(e, Transform) or start_ns <= e.stamp_ns <= end_ns]
    claimed = wrong_start(here, here.poses[first], rng) if task.startswith("kidnapped") else None
    if task.endswith("crowd"):
        events = crowded(events, rng)
    method = IspaceMcl(IspaceMclConfig(start=claimed, start_std=(0.1, 0.1, 0.05)), seed, here.grid)
    for event in events:
        method.process(event)
    found, _ = method.result().trajectory.at(here.stamps_ns[first : last + 1])
    off = found - here.poses[first : last + 1]
    good = (np.hypot(off[:, 0], off[:, 1]) < 0.5) & (np.abs(se2.wrap_angle(off[:, 2])) < np.radians(10.0))
    driven = travel[first : last + 1] - travel[first]
    bad = np.flatnonzero(~good)
    return DriveResult(
        bool(good[driven > driven[-1] - HELD_M].all()), float(driven[bad[-1]]) if len(bad) else 0.0
    )


def wrong_start(
    here: Place, truth: NDArray[np.float64], rng: np.random.Generator
) -> tuple[float, float, float]:
    """A free pose more than 5 m from the truth."""
    free = free_cells(here.grid, 0.3)
    while True:
        x, y, yaw = (float(v) for v in draw_free_poses(free, here.grid, 1, rng)[0])
        if np.hypot(x - truth[0], y - truth[1]) > 5.0:
            return x, y, yaw


def crowded(events: list[Event], rng: np.random.Generator) -> list[Event]:
    """The events with eight people who walk around the robot and together hide half of its view."""
    people = 8
    bearings, distances = rng.random(people), rng.uniform(0.6, 4.0, people)
    drift = rng.normal(0.0, 0.01, people)
    out: list[Event] = []
    for event in events:
        if isinstance(event, LaserScan):
            n = len(event.ranges_m)
            bearings = (bearings + drift + rng.normal(0.0, 0.01, people)) % 1.0
            distances = np.clip(distances + rng.normal(0.0, 0.1, people), 0.5, 4.0)
            ranges = event.ranges_m.copy()
            width = CROWD_RATIO / people
            for bearing, distance in zip(bearings, distances, strict=True):
                hidden = np.arange(int((bearing - width / 2) * n), int((bearing + width / 2) * n)) % n
                ranges[hidden] = np.minimum(ranges[hidden], distance + rng.normal(0.0, 0.05, len(hidden)))
            event = replace(event, ranges_m=readonly(ranges, np.float32))
        out.append(event)
    return out
