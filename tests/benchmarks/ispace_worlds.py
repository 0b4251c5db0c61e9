"""Simulated corridors for the localization with fixed cameras: each number is a drive of its own among people of its own.

`python -m tests.benchmarks.ispace_worlds KIND FIRST LAST` renders logs ahead of a benchmark; they are kept in out/benchmarks.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import WorldConfig, load_world
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "out" / "benchmarks" / "ispace"
LENGTH_M, MIDDLE_M = 30.0, 1.3
LANES_M = (0.65, 1.95)
ROBOT_MPS = 0.5

Document = dict[str, Any]
Adding = Callable[[np.random.Generator, Document], None]


def world_of(kind: str, number: int) -> WorldConfig:
    """The corridor of a kind, with a start, a route and people that the number determines."""
    rng = np.random.default_rng([number, list(KINDS).index(kind)])
    base, _ = load_world("ispace-corridor-blind" if kind == "blind" else "ispace-corridor")
    document = base.model_dump(mode="json", exclude_defaults=True)
    document["seed"] = 1000 + number
    document["sensors"].pop("cameras")
    add_drive(rng, document, kind)
    document["people"] = [walker(rng) for _ in range(int(rng.integers(2, 5)))]
    KINDS[kind](rng, document)
    return WorldConfig.model_validate(document)


def add_drive(rng: np.random.Generator, document: Document, kind: str) -> None:
    """Add a start, a heading, and two legs of at least 8 m; blind: from outside all views into one and back."""
    legs = rng.uniform(3.0, LENGTH_M - 3.0, 3)
    while min(abs(legs[1] - legs[0]), abs(legs[2] - legs[1])) < 8.0:
        legs = rng.uniform(3.0, LENGTH_M - 3.0, 3)
    if kind == "blind":
        far = rng.choice([rng.uniform(4.0, 6.0), rng.uniform(24.0, 26.0)])
        legs = np.array([rng.uniform(13.0, 17.0), far, rng.uniform(13.0, 17.0)])
    yaw = float(rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.2))
    document["robot"] |= {
        "start": [float(legs[0]), MIDDLE_M + float(rng.normal(0.0, 0.1)), yaw],
        "route": [[float(x), MIDDLE_M] for x in legs[1:]],
        "speed_mps": ROBOT_MPS,
    }


def walker(rng: np.random.Generator) -> Document:
    """A person who walks up and down a part of the corridor."""
    ends = rng.uniform(1.0, LENGTH_M - 1.0, 2)
    while abs(ends[1] - ends[0]) < 4.0:
        ends = rng.uniform(1.0, LENGTH_M - 1.0, 2)
    lane = float(rng.choice(LANES_M) + rng.normal(0.0, 0.05))
    return person([[float(x), lane] for x in ends], float(rng.uniform(0.6, 1.3)), rng)


def person(
    path: list[list[float]], speed_mps: float, rng: np.random.Generator, starts_at_s: float = 0.0
) -> Document:
    """A person in clothes of a random colour."""
    return {
        "path": path,
        "speed_mps": speed_mps,
        "speed_deviation_mps": 0.2 if speed_mps > 0.1 else 0.0,
        "starts_at_s": starts_at_s,
        "colour": [int(c) for c in rng.integers(40, 200, 3)],
    }


def add_standing(rng: np.random.Generator, document: Document) -> None:
    """Add three people who hardly move."""
    for x in rng.uniform(2.0, LENGTH_M - 2.0, 3).tolist():
        lane = float(rng.choice(LANES_M))
        document["people"].append(person([[x, lane], [x + 0.1, lane]], 0.01, rng))


def add_companions(rng: np.random.Generator, document: Document) -> None:
    """Add a person on each side of the robot, with its speed, on its first leg and back."""
    start, first = document["robot"]["start"][0], document["robot"]["route"][0][0]
    for lane in LANES_M:
        document["people"].append(person([[start, lane], [first, lane]], ROBOT_MPS, rng))


def add_mirrored(rng: np.random.Generator, document: Document) -> None:
    """Add a person who stands for half a minute where the robot would be if the corridor were rotated by pi."""
    x = LENGTH_M - document["robot"]["start"][0]
    away = x + (6.0 if x < LENGTH_M / 2 else -6.0)
    document["people"].append(person([[x, 1.0], [away, LANES_M[0]]], 0.9, rng, starts_at_s=30.0))


def add_nobody(rng: np.random.Generator, document: Document) -> None:
    """Add nobody else."""


def cover(rng: np.random.Generator, document: Document) -> None:
    """Replace the cameras by eight smaller ones that cover the corridor from both sides, so that nobody hides the robot."""
    camera = document["fixed_cameras"][0] | {"width_px": 160, "height_px": 120, "focal_px": 120.0}
    views = [(0.1, 0), (7.5, 0), (7.5, 180), (15.0, 0), (15.0, 180), (22.5, 0), (22.5, 180), (29.9, 180)]
    document["fixed_cameras"] = [
        camera | {"name": f"ispace{k + 1}", "extrinsics": camera["extrinsics"] | {"x": x, "yaw_deg": yaw}}
        for k, (x, yaw) in enumerate(views)
    ]


KINDS: Mapping[str, Adding] = {
    "beside": add_companions,
    "blind": add_nobody,
    "mirrored": add_mirrored,
    "standing": add_standing,
    "walking": add_nobody,
    "covered": cover,
}


def log_of(kind: str, number: int) -> Path:
    """The log of a drive, rendered when it is not there yet; its truth lies beside it."""
    log = FOLDER / f"{kind}-{number}.mcap"
    if not (log.exists() and log.with_suffix(".truth").is_dir()):
        FOLDER.mkdir(parents=True, exist_ok=True)
        record_world(world_of(kind, number), REPOSITORY / "configs" / "worlds", log, force=True)
    return log


def main(arguments: Sequence[str]) -> None:
    """Render the logs of one kind."""
    kind, first, last = arguments
    for number in range(int(first), int(last) + 1):
        log_of(kind, number)


if __name__ == "__main__":
    main(sys.argv[1:])
