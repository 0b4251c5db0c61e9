"""slam-sd where scans say little about the motion, or stop for a while: how wrong is the path, and does the run say so.

A smooth and a round corridor, scans a metre and a turn apart, and office floors by seed with a gap of 20 s in the scans, or with
a robot that is carried in mid-log. A run counts as said if its status is not `complete`.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from gridslam import api
from gridslam.core import poses as se2
from gridslam.core.messages import Event, Odometry
from gridslam.evaluation.document import EvaluationOptions
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.input_kinds import InputDrive, drive, plain, scanning

SEEDS = range(1, 9)  # of office floors
WORLD_SEEDS = range(1, 4)
OPTIONS = EvaluationOptions(align="se2", sync="interpolate")
CARRIED_S = 8.0  # of the drive that are cut out
GAP_S = 20.0


def rows() -> Iterator[BenchmarkRow]:
    """The worst error, and the fraction of runs that are said, of each kind."""
    for name, world in (("smooth", smooth), ("round", round_corridor), ("sparse", sparse)):
        yield from summary(name, [mapped_world(world(), name, seed) for seed in WORLD_SEEDS])
    for name, maker in (("gap", paused), ("carried", carried)):
        yield from summary(name, [mapped_floor(maker, name, seed) for seed in SEEDS])


def summary(name: str, found: list[tuple[float, bool]]) -> Iterator[BenchmarkRow]:
    """Rows of runs' errors (m) and whether they are said."""
    unsaid_m = [error_m for error_m, is_said in found if not is_said]
    yield BenchmarkRow(f"hard_drives.{name}.ape", max(error_m for error_m, _ in found), "m")
    yield BenchmarkRow(f"hard_drives.{name}.ape.unsaid", max(unsaid_m, default=0.0), "m")
    yield BenchmarkRow(f"hard_drives.{name}.said", 1.0 - len(unsaid_m) / len(found), "of the runs")


def mapped_world(world: dict[str, Any], name: str, seed: int) -> tuple[float, bool]:
    """APE (m) in a world, and whether the run is said."""
    with tempfile.TemporaryDirectory() as scratch:
        file, log = Path(scratch) / "world.yaml", Path(scratch) / "log.mcap"
        file.write_text(yaml.safe_dump({**world, "seed": seed}))
        api.simulate(file, log)
        return judged(log, log.with_suffix(".truth"), f"{name}, seed {seed}")


def mapped_floor(maker: Callable[[InputDrive, Path], str], name: str, seed: int) -> tuple[float, bool]:
    """APE (m) on an office floor as a maker records it, which returns the true path; and whether the run is said."""
    with tempfile.TemporaryDirectory() as scratch:
        log, truth = Path(scratch) / "log.mcap", Path(scratch) / "truth.tum"
        truth.write_text(maker(drive(seed, is_elsewhere=True), log))
        return judged(log, truth, f"{name}, seed {seed}")


def judged(log: Path, truth: Path, name: str) -> tuple[float, bool]:
    """APE (m) of slam-sd on a log, and whether the run says that it may be wrong."""
    run = api.map_log(log, "slam-sd")
    error_m = float(api.evaluate(run, truth, options=OPTIONS)["ape"]["trans"]["rmse"])
    say(f"hard drives, {name}: {error_m:.3f} m, {run.status}")
    return error_m, run.status != "complete"


def corridor(walls: list[dict[str, Any]], route: list[tuple[float, float]]) -> dict[str, Any]:
    """A world with a lidar of 10 m, driven along a route."""
    (x0, y0), (x1, y1) = route[:2]
    wheels = {
        "left_radius_error": -0.003,
        "right_radius_error": 0.003,
        "slip_mean": 0.01,
        "slip_deviation": 0.002,
    }
    robot = {
        "start": [x0, y0, math.degrees(math.atan2(y1 - y0, x1 - x0))],
        "route": [[*point] for point in route[1:]],
    }
    lidar = {
        "rate_hz": 5,
        "beams": 360,
        "range_max_m": 10.0,
        "sweep_s": 0.05,
        "noise_m": 0.015,
        "dropout": 0.01,
    }
    return {
        "walls": walls,
        "robot": {**robot, "speed_mps": 0.9, "wheels": wheels},
        "sensors": {"lidar": lidar, "odometry": {"rate_hz": 15}},
        "max_duration_s": 5000,
    }  # fmt: skip


def smooth() -> dict[str, Any]:
    """A corridor of 200 m without features, driven to and fro."""
    ahead = [(float(x), 1.2) for x in range(2, 199, 4)]
    return corridor([{"rectangle": [0.0, 0.0, 200.0, 2.4]}], [*ahead, *ahead[::-1]])


def round_corridor() -> dict[str, Any]:
    """A ring without features, driven twice."""
    angles = np.linspace(0.0, math.tau, 121)
    walls = [{"points": [[r * math.cos(a), r * math.sin(a)] for a in angles.tolist()]} for r in (20.0, 22.5)]
    driven = np.linspace(0.0, 2.0 * math.tau, 81).tolist()
    return corridor(walls, [(21.2 * math.cos(a), 21.2 * math.sin(a)) for a in driven])


def sparse() -> dict[str, Any]:
    """Rooms about a block, driven twice at 1.8 m/s with 1.5 scans a second."""
    walls = [{"rectangle": [0.0, 0.0, 30.0, 20.0]}, {"rectangle": [6.0, 6.0, 24.0, 14.0]}]
    walls += [{"points": [[12.0, 0.0], [12.0, 3.0]]}, {"points": [[18.0, 20.0], [18.0, 17.0]]}]
    corners = [(3.0, 3.0), (27.0, 3.0), (27.0, 17.0), (3.0, 17.0)]
    world = corridor(walls, [*corners, *corners, corners[0]])
    world["robot"] |= {"speed_mps": 1.8, "turn_radps": 2.0}
    world["robot"]["wheels"] |= {"max_speed_mps": 2.5}
    world["sensors"]["lidar"] |= {"rate_hz": 1.5, "range_max_m": 12.0}
    return world


def paused(floor: InputDrive, log: Path) -> str:
    """A lidar that pauses in mid-log, while odometry goes on."""
    middle_s = 0.5 * (floor.events[-1].stamp_ns - floor.start_ns) * 1e-9
    scanning((0.0, middle_s), (middle_s + GAP_S, math.inf))(floor, log)
    return floor.truth


def carried(floor: InputDrive, log: Path) -> str:
    """A robot that is carried along `CARRIED_S` of its drive: the log goes on there, and odometry where it was."""
    cut_ns, first_ns = round(CARRIED_S * 1e9), (floor.start_ns + floor.events[-1].stamp_ns) // 2
    before = [event for event in floor.events if event.stamp_ns < first_ns]
    last = next(event.pose for event in reversed(before) if isinstance(event, Odometry))
    after: list[Event] = []
    T_last_odom: np.ndarray | None = None
    for event in floor.events[len(before) :]:
        if event.stamp_ns < first_ns + cut_ns:
            continue
        if isinstance(event, Odometry):
            if T_last_odom is None:
                T_last_odom = se2.compose(last, se2.inverse(event.pose))
            x, y, yaw = se2.compose(T_last_odom, event.pose).tolist()
            event = replace(event, x_m=x, y_m=y, yaw_rad=yaw)
        after.append(replace(event, stamp_ns=event.stamp_ns - cut_ns))
    plain(replace(floor, events=[*before, *after]), log)
    return "".join(_shortened(line, first_ns, cut_ns) for line in floor.truth.splitlines())


def _shortened(line: str, first_ns: int, cut_ns: int) -> str:
    """A line of a TUM file after the cut; empty if its pose is cut out."""
    stamp, rest = line.split(" ", 1)
    seconds, _, fraction = stamp.partition(".")
    stamp_ns = int(seconds) * 10**9 + int(fraction.ljust(9, "0"))
    if first_ns <= stamp_ns < first_ns + cut_ns:
        return ""
    stamp_ns -= cut_ns if stamp_ns >= first_ns else 0
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d} {rest}\n"
