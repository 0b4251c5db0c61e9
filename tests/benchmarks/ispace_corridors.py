"""Corridors by seed for the localization with fixed cameras: of any length, with bays that make their parts look alike.

No images are rendered: `seen_corridor.py` says what the cameras detect. Seeds from 100 on are for tuning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.simulation.world_config import WorldConfig, load_world
from tests.benchmarks.ispace_worlds import person

Document = dict[str, Any]
Floats = NDArray[np.float64]

LENGTHS_M, WIDTHS_M = (30.0, 100.0), (2.0, 2.8)
BAYS_M, BAY_WIDTH_M, BAY_DEPTHS_M = (3.0, 6.0), 1.0, (0.2, 0.4)  # period, width and depth of the bays
COVERAGE = (0.3, 1.0)  # of the floor by the cameras' views
# Before a camera, the corridor is in its view from there on, and over this length
NEAREST_M, VIEW_M = 1.5, 7.0
PEOPLE = (2, 8)
LEGS_M = (8.0, 25.0)
ROBOT_MPS = 0.5
MIN_IN_VIEW_M = 5.0  # of the drive


def world_of(seed: int) -> WorldConfig:
    """The corridor of a seed, with its cameras, people and drive."""
    rng = np.random.default_rng([seed, 21])
    length, width = float(rng.uniform(*LENGTHS_M)), float(rng.uniform(*WIDTHS_M))
    document = load_world("ispace-corridor")[0].model_dump(mode="json", exclude_defaults=True)
    document["seed"] = 5000 + seed
    document["sensors"].pop("cameras")
    document["walls"] = walls(rng, length, width)
    count = max(round(float(rng.uniform(*COVERAGE)) * length / VIEW_M), 1)
    views = add_cameras(rng, document, count, length, width)
    legs = drive(rng, length, views)
    yaw = float((0.0 if legs[1] > legs[0] else np.pi) + rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.2))
    document["robot"] |= {
        "start": [legs[0], width / 2 + float(rng.normal(0.0, 0.1)), yaw],
        "route": [[x, width / 2] for x in legs[1:]],
        "speed_mps": ROBOT_MPS,
    }
    people = int(rng.integers(PEOPLE[0], PEOPLE[1] + 1))
    document["people"] = [walker(rng, length, width) for _ in range(people)]
    return WorldConfig.model_validate(document)


def walls(rng: np.random.Generator, length: float, width: float) -> list[Document]:
    """Two long walls with a bay at every period, on both sides at the same places, and the two ends."""
    period, depth = float(rng.uniform(*BAYS_M)), float(rng.uniform(*BAY_DEPTHS_M))
    starts = np.arange(0.5 * period, length - BAY_WIDTH_M - 0.5, period).tolist()
    sides = []
    for y, outward in ((0.0, -depth), (width, depth)):
        points = [[0.0, y]]
        for x in starts:
            end = x + BAY_WIDTH_M
            points += [[x, y], [x, y + outward], [end, y + outward], [end, y]]
        sides.append({"points": [*points, [length, y]], "texture": "plaster"})
    return [*sides, *({"points": [[x, 0.0], [x, width]]} for x in (0.0, length))]


def add_cameras(
    rng: np.random.Generator, document: Document, count: int, length: float, width: float
) -> list[tuple[float, float]]:
    """Replace the cameras by `count` under the ceiling; the parts (from, to) of the corridor in their views."""
    camera = document["fixed_cameras"][0] | {"width_px": 160, "height_px": 120, "focal_px": 120.0}
    slot, cameras, views = length / count, [], []
    for k in range(count):
        start = k * slot + float(rng.uniform(0.0, max(slot - VIEW_M, 0.1)))
        faces_back = bool(rng.integers(2))
        x = float(np.clip(start + (VIEW_M + NEAREST_M if faces_back else -NEAREST_M), 0.1, length - 0.1))
        place = {"x": x, "y": width / 2, "yaw_deg": 180.0 if faces_back else 0.0}
        cameras.append(camera | {"name": f"ispace{k + 1}", "extrinsics": camera["extrinsics"] | place})
        views.append((start, start + VIEW_M))
    document["fixed_cameras"] = cameras
    return views


def drive(rng: np.random.Generator, length: float, views: list[tuple[float, float]]) -> list[float]:
    """Start and ends of two legs along the corridor, in views for some metres."""
    while True:
        legs = rng.uniform(2.0, length - 2.0, 3)
        lengths = np.abs(np.diff(legs))
        if lengths.min() < LEGS_M[0] or lengths.max() > LEGS_M[1]:
            continue
        path = np.concatenate([np.arange(*sorted(leg), 0.1) for leg in (legs[:2], legs[1:])])
        if sum(0.1 * any(a < x < b for a, b in views) for x in path) >= MIN_IN_VIEW_M:
            return [float(x) for x in legs]


def walker(rng: np.random.Generator, length: float, width: float) -> Document:
    """A person who walks up and down a part of the corridor."""
    ends = rng.uniform(1.0, length - 1.0, 2)
    while not 4.0 < abs(ends[1] - ends[0]) < 30.0:
        ends = rng.uniform(1.0, length - 1.0, 2)
    lane = float(rng.choice([0.25, 0.75]) * width + rng.normal(0.0, 0.05))
    return person([[float(x), lane] for x in ends], float(rng.uniform(0.6, 1.3)), rng)


def is_in_view(world: WorldConfig, positions: Floats) -> NDArray[np.bool_]:
    """Which cameras `(cameras, n)` of a corridor have positions `(n, 2)` in view, if nobody hides them."""
    ahead = np.array(
        [
            (positions[:, 0] - camera.extrinsics.x) * np.cos(np.radians(camera.extrinsics.yaw_deg))
            for camera in world.fixed_cameras
        ]
    )
    return np.asarray((ahead > NEAREST_M) & (ahead < NEAREST_M + VIEW_M))
