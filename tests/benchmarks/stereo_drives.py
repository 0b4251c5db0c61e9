"""Rendered drives of a robot with a stereo head through rooms with boxes: each number is another room and another route.

`python -m tests.benchmarks.stereo_drives FIRST LAST` renders logs ahead of a benchmark; they are kept in out/benchmarks.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString

from gridslam.logs import LogConfig, open_log
from gridslam.maps.map_server import load_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.registry import METHODS
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.frames import StereoFrame
from gridslam.methods.stereo_bayes.method import StereoBayes
from gridslam.motion.absolute_pose_filter import PoseBelief
from gridslam.runs.feed import feed
from gridslam.runs.run_config import load_config
from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import WorldConfig, load_world
from tests.benchmarks.stereo_rooms import contours_of, footprint
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "out" / "benchmarks" / "stereo"
INSET_M = 1.2  # of the route from the walls
FREE_M = 0.45  # beside the route
GROUP_PX = 4  # columns with a common match
TEXTURES = ("brick", "checks", "plaster", "wood")
CAMERA = {
    "name": "stereo",
    "kind": "stereo",
    "rate_hz": 2,
    "extrinsics": {"x": 0.1, "y": 0.06, "z": 0.6},
    "width_px": 320,
    "height_px": 240,
    "focal_px": 260.0,
    "baseline_m": 0.12,
    "latency_s": 0.01,
    "jitter_s": 0.002,
}


def world_of(number: int) -> WorldConfig:
    """A room of about 6 x 5 m with five to eight boxes at its walls and in its middle, and a closed route between them."""
    rng = np.random.default_rng([number, 7])
    base, _ = load_world("stereo-room")
    document: dict[str, Any] = base.model_dump(mode="json", exclude_defaults=True)
    length, width = rng.uniform(5.5, 7.5), rng.uniform(4.5, 6.0)
    left, low = rng.uniform(0.0, 0.05, 2)
    room = [left, low, left + length, low + width]
    inner = np.array([length - 2 * INSET_M, width - 2 * INSET_M])
    route = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * inner + np.array([left + INSET_M, low + INSET_M])
    route += rng.uniform(-0.3, 0.3, (4, 2))
    route = np.roll(route if rng.random() < 0.5 else route[::-1], int(rng.integers(4)), axis=0)
    ahead = route[1] - route[0]
    document |= {
        "seed": 1000 + number,
        "walls": [{"rectangle": room, "texture": "brick", "colour": colour_of(rng)}],
        "boxes": boxes_of(rng, room, route),
        "truth": {"resolution_m": 0.05},
    }
    document.pop("cylinders")
    document["robot"] |= {
        "start": [*route[0].tolist(), float(np.arctan2(ahead[1], ahead[0]))],
        "route": [*route[1:].tolist(), route[0].tolist(), route[1].tolist()],
    }
    document["sensors"]["cameras"] = [CAMERA]
    return WorldConfig.model_validate(document)


def boxes_of(rng: np.random.Generator, room: Sequence[float], route: NDArray[np.float64]) -> list[Any]:
    """Boxes at random positions beside the route."""
    line = LineString([*route, route[0]])
    boxes: list[Any] = []
    wanted = int(rng.integers(5, 9))
    while len(boxes) < wanted:
        size = rng.uniform(0.25, 1.0, 2)
        centre = rng.uniform(np.add(room[:2], 0.2), np.subtract(room[2:], 0.2))
        yaw = float(rng.choice([0.0, rng.uniform(0.0, 90.0)]))
        if footprint(centre, size, np.radians(yaw)).distance(line) > FREE_M:
            boxes.append(
                {
                    "centre": centre.tolist(),
                    "size": size.tolist(),
                    "yaw_deg": yaw,
                    "height_m": float(rng.uniform(0.7, 1.4)),
                    "texture": str(rng.choice(TEXTURES)),
                    "colour": colour_of(rng),
                }
            )
    return boxes


def colour_of(rng: np.random.Generator) -> list[int]:
    """A random colour."""
    return [int(c) for c in rng.integers(70, 200, 3)]


@dataclass(frozen=True, slots=True)
class StereoDrive:
    """The frames of a log with the estimated poses, the true map, and the contours of the obstacles in pieces."""

    frames: list[tuple[StereoFrame, PoseBelief]]
    truth: OccupancyGrid
    contours: list[NDArray[np.float64]]


class _Recorder(StereoBayes):
    """Records the frames instead of mapping them."""

    def __init__(self, config: StereoBayesConfig) -> None:
        super().__init__(config, 0)
        self.frames: list[tuple[StereoFrame, PoseBelief]] = []

    def _use(self, frame: StereoFrame, belief: PoseBelief) -> None:
        self._record(frame.stamp_ns, belief)
        self.frames.append((frame, belief))


def drive_of(number: int) -> StereoDrive:
    """The frames of a drive, matched by OpenCV."""
    config = load_config("stereo-bayes").method
    assert isinstance(config, StereoBayesConfig)
    recorder = _Recorder(config)
    path = log_of(number)
    with open_log(path, LogConfig(), METHODS["stereo-bayes"].reads) as log:
        feed(log, recorder, lambda _: None, lambda: False)
    recorder.result()
    return StereoDrive(
        recorder.frames, load_map(path.with_suffix(".truth") / "map.yaml"), _contours(world_of(number))
    )


def _contours(world: WorldConfig) -> list[NDArray[np.float64]]:
    room = world.walls[0].rectangle
    assert room is not None
    boxes = [footprint(np.array(b.centre), np.array(b.size), np.radians(b.yaw_deg)) for b in world.boxes]
    return contours_of(room, boxes)


def with_false_matches(
    disparity: NDArray[np.float32], rate: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """A disparity image in which a fraction of the columns, in groups, has random disparities."""
    found = disparity.copy()
    rows, groups = found.shape[0], found.shape[1] // GROUP_PX
    wrong = np.zeros(groups, bool)
    while wrong.mean() < rate:
        first = int(rng.integers(groups))
        wrong[first : first + int(rng.integers(1, 4))] = True
    for group in np.flatnonzero(wrong):
        part = found[rows // 4 : 3 * rows // 4, group * GROUP_PX : (group + 1) * GROUP_PX]
        part[:] = rng.uniform(1.0, 64.0) + rng.normal(0.0, 0.3, part.shape)
    return found


def log_of(number: int) -> Path:
    """The log of a drive, rendered if it does not exist yet; its truth is beside it."""
    log = FOLDER / f"room-{number}.mcap"
    if not (log.exists() and log.with_suffix(".truth").is_dir()):
        FOLDER.mkdir(parents=True, exist_ok=True)
        record_world(world_of(number), REPOSITORY / "configs" / "worlds", log, force=True)
    return log


def main(arguments: Sequence[str]) -> None:
    """Render the logs FIRST to LAST."""
    first, last = arguments
    for number in range(int(first), int(last) + 1):
        log_of(number)


if __name__ == "__main__":
    main(sys.argv[1:])
