"""Global localization, and recovery from a wrong start pose and from kidnapping, on recorded logs; with crowds, and on aged maps.

The map is that of the first passes, the drives are later passes of 15 m. With GRIDSLAM_RELOCALIZATION_STARTS=20 in the
environment there are 20 starts in each log. A drive has succeeded when the robot was within 0.5 m and 10 degrees of the reference
over all of the last 3 m. Kidnapped: the start pose is more than 5 m off, with standard deviations of 0.1 m and 0.05 rad. Carried:
after the drive the robot goes on at another start, which the odometry does not show. In the crowd half of all beams end at
people. An aged map lacks walls and has furniture elsewhere.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, Transform, readonly
from gridslam.filters.free_space import draw_free_poses, free_cells
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from tests.benchmarks.aged_maps import aged
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.passed_places import NAMES, passed_place, starts, travel_of
from tests.benchmarks.real_places import RealPlace, data_dir

Floats = NDArray[np.float64]

CARRIED_STARTS = 20  # from which the place that the robot is carried to is chosen
STARTS = int(os.environ.get("GRIDSLAM_RELOCALIZATION_STARTS", "2"))
TRAVEL_M = 15.0
HELD_M = 3.0
CROWD_RATIO = 0.5
FAR_M = 5.0  # at least, between a wrong start, or the place that the robot is carried to, and where it was
# And the smallest fraction of successes; none yet on aged maps
TASKS: dict[str, float | None] = {
    "global": 0.95,
    "kidnapped": 0.95,
    "carried": 0.95,
    "global-crowd": 0.9,
    "kidnapped-crowd": 0.9,
    "global-aged": None,
    "kidnapped-aged": None,
}
WRONG_M = 1.0


@dataclass(frozen=True, slots=True)
class DriveResult:
    """Whether the robot was found, the travel (m) after which it remained found, the root mean square error (m) from then on,
    and the longest travel (m) over which a pose more than a metre off was called localized.
    """

    found: bool
    converged_m: float
    rms_m: float
    wrong_m: float


def rows() -> Iterator[BenchmarkRow]:
    """The fraction of successes, the median travel to convergence and the worst travel while wrong, for every log and task."""
    folder = data_dir()
    if folder is None:
        return
    for name in NAMES:
        here, is_again = passed_place(folder, name)
        for task, min_found in TASKS.items():
            results = results_of(here, is_again, task)
            label = f"localize.{name}.{task}"
            found = [r for r in results if r.found]
            say(f"{label}: failed from {[k for k, r in enumerate(results) if not r.found] or 'nowhere'}")
            yield BenchmarkRow(f"{label}.found", len(found) / STARTS, "", min_found, at_least=True)
            yield BenchmarkRow(f"{label}.converged", float(np.median([r.converged_m for r in results])), "m")
            yield BenchmarkRow(f"{label}.rms", float(np.median([r.rms_m for r in found] or [np.nan])), "m")
            yield BenchmarkRow(f"{label}.wrong", max(r.wrong_m for r in results), "m")


def results_of(here: RealPlace, is_again: NDArray[np.bool_], task: str) -> list[DriveResult]:
    """The results of a task from all starts."""
    firsts, others = (starts(here, is_again, TRAVEL_M, count) for count in (STARTS, CARRIED_STARTS))
    return [trial(here, task, first, number, others) for number, first in enumerate(firsts)]


def trial(here: RealPlace, task: str, first: int, number: int, others: Sequence[int]) -> DriveResult:
    """One drive from a start; where it is carried, it is to one of the other starts."""
    rng = np.random.default_rng(number)
    events, stamps_ns, truth = drive_of(here, first)
    claimed = None
    if task == "carried":
        claimed = as_start(truth[0])
        other = next(o for o in np.roll(others, -number - len(others) // 2) if is_far(here, o, first))
        carried, stamps_ns, truth = drive_of(here, other)
        events, shift_ns = spliced(events, carried)
        stamps_ns = stamps_ns + shift_ns
    elif task.startswith("kidnapped"):
        claimed = wrong_start(here, truth[0], rng)
    if task.endswith("crowd"):
        events = crowded(events, rng)
    grid: OccupancyGrid = aged(here.grid, number) if task.endswith("aged") else here.grid
    method = IspaceMcl(IspaceMclConfig(start=claimed, start_std=(0.1, 0.1, 0.05)), number, grid)
    for event in events:
        method.process(event)
    result = method.result()
    path = result.trajectory
    found, _ = path.at(stamps_ns)
    statuses = np.array([row[-1] for row in result.tables["localization"].rows])
    at = np.clip(np.searchsorted(path.stamps_ns, stamps_ns), 0, len(path) - 1)
    return judged(found, truth, statuses[at] == "localized")


def judged(found: Floats, truth: Floats, is_localized: NDArray[np.bool_]) -> DriveResult:
    """The result of poses `(n, 3)` where the truth is `(n, 3)`."""
    off = found - truth
    off_m, driven = np.hypot(off[:, 0], off[:, 1]), travel_of(truth)
    good = (off_m < 0.5) & (np.abs(se2.wrap_angle(off[:, 2])) < np.radians(10.0))
    bad = np.flatnonzero(~good)
    first = int(bad[-1]) + 1 if len(bad) else 0
    rms_m = float(np.sqrt((off_m[first:] ** 2).mean())) if first < len(off_m) else np.nan
    wrong, edges = is_localized & (off_m > WRONG_M), np.flatnonzero
    changes = np.diff(np.r_[0, wrong.astype(np.int64), 0])
    stretches = zip(edges(changes == 1), edges(changes == -1), strict=True)
    return DriveResult(
        bool(good[driven > driven[-1] - HELD_M].all()),
        float(driven[first - 1]) if first else 0.0,
        rms_m,
        max((float(driven[end - 1] - driven[start]) for start, end in stretches), default=0.0),
    )


def drive_of(here: RealPlace, first: int) -> tuple[list[Event], NDArray[np.int64], Floats]:
    """The events of a drive of TRAVEL_M from a row of the poses, and its true poses `(n, 3)` at stamps `(n,)`."""
    travel = travel_of(here.poses)
    last = int(np.searchsorted(travel, travel[first] + TRAVEL_M))
    stamps_ns = here.stamps_ns[first : last + 1]
    start_ns, end_ns = int(stamps_ns[0]), int(stamps_ns[-1])
    events = [e for e in here.events if isinstance(e, Transform) or start_ns <= e.stamp_ns <= end_ns]
    return events, stamps_ns, here.poses[first : last + 1]


def is_far(here: RealPlace, first: int, other: int) -> bool:
    """Whether a drive begins far from where another one ends."""
    _, _, truth = drive_of(here, other)
    return bool(np.hypot(*(here.poses[first] - truth[-1])[:2]) > FAR_M)


def spliced(before: list[Event], after: list[Event]) -> tuple[list[Event], int]:
    """Two drives as one whose odometry goes on where it was, and the shift (ns) of the second one's stamps."""
    kept = [e for e in after if not isinstance(e, Transform)]
    shift_ns = before[-1].stamp_ns - kept[0].stamp_ns + 100_000_000
    last = next(e for e in reversed(before) if isinstance(e, Odometry))
    first = next(e for e in kept if isinstance(e, Odometry))
    T_odom_carried = se2.compose(last.pose, se2.inverse(first.pose))
    joined = list(before)
    for event in kept:
        moved = replace(event, stamp_ns=event.stamp_ns + shift_ns)
        if isinstance(moved, Odometry):
            x, y, yaw = se2.compose(T_odom_carried, moved.pose).tolist()
            moved = replace(moved, x_m=x, y_m=y, yaw_rad=yaw)
        joined.append(moved)
    return joined, shift_ns


def as_start(pose: Floats) -> tuple[float, float, float]:
    """The pose as a config takes it."""
    x, y, yaw = pose.tolist()
    return x, y, yaw


def wrong_start(here: RealPlace, truth: Floats, rng: np.random.Generator) -> tuple[float, float, float]:
    """A free pose far from the truth."""
    free = free_cells(here.grid, 0.3)
    while True:
        pose = draw_free_poses(free, here.grid, 1, rng)[0]
        if np.hypot(*(pose - truth)[:2]) > FAR_M:
            return as_start(pose)


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


def main(names: Sequence[str]) -> None:
    """Print the results of some tasks of a log: NAME TASK ..."""
    folder = data_dir()
    assert folder is not None
    here, is_again = passed_place(folder, names[0])
    for task in names[1:] or TASKS:
        results = results_of(here, is_again, task)
        found = [r for r in results if r.found]
        say(
            f"{names[0]} {task}: {len(found)} of {len(results)}, failed from "
            f"{[k for k, r in enumerate(results) if not r.found] or 'nowhere'}; found after "
            f"{np.median([r.converged_m for r in results]):.1f} m, at most {max(r.converged_m for r in results):.1f} m; "
            f"error {np.median([r.rms_m for r in found] or [np.nan]):.3f} m; localized and wrong for at most "
            f"{max(r.wrong_m for r in results):.1f} m"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
