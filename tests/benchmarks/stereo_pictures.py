"""Pictures for docs/stereo-bayes.md: the scene of figures 8 and 9, the sample room, the street.

`python -m tests.benchmarks.stereo_pictures` writes them into docs/images.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import StereoRays, range_edges
from gridslam.runs.run import run_map
from gridslam.runs.run_config import load_config
from tests.benchmarks.harness import say
from tests.benchmarks.kitti import STREET, true_path, write_street
from tests.benchmarks.real_places import data_dir
from tests.conftest import REPOSITORY

IMAGES = REPOSITORY / "docs" / "images"
FOCAL_BASELINE = 31.2
OBSTACLE_M = 1.52
VISIBLE = [20.0] * 10 + [OBSTACLE_M] * 6  # a free room, then an obstacle in it
BEHIND = [3.5, 3.5]  # and two frames with a match behind it


def belief_of(config: StereoBayesConfig, frames: list[float]) -> BeliefMap:
    """The map after frames of a surface at the given distances (m) before a narrow sensor."""
    belief = BeliefMap(config)
    bearings = np.linspace(-0.4, 0.4, 81)
    for depth in frames:
        disparity = np.where(np.abs(bearings) < 0.2, FOCAL_BASELINE / depth, FOCAL_BASELINE / 20.0)
        edges = np.cos(bearings)[:, None] * range_edges(config)[None]
        rays = StereoRays(bearings, disparity, edges, np.zeros(2), FOCAL_BASELINE)
        belief.update(np.zeros(3), 1e-8 * np.eye(3), rays, belief.noise(64.0))
    return belief


def scene(likelihood: str, frames: list[float]) -> NDArray[np.uint8]:
    """The map after these frames, dark where occupied."""
    config = StereoBayesConfig.model_validate({"likelihood": likelihood, "max_range_m": 5.0})
    layer = belief_of(config, frames).layer()
    low = layer.geometry.cells(np.array([[-0.1, -2.1]]))[0]
    high = layer.geometry.cells(np.array([[4.6, 2.1]]))[0]
    p = layer.values[low[0] : high[0], low[1] : high[1]][::-1]
    grey = np.rint(255.0 * (1.0 - p)).astype(np.uint8)
    return np.asarray(cv2.resize(grey, None, fx=3, fy=3, interpolation=cv2.INTER_NEAREST), np.uint8)


def false_match_scene() -> NDArray[np.uint8]:
    """Grey levels: left after VISIBLE, right after two false matches; above the conventional likelihood, below the chain."""
    rows = [
        np.hstack(
            [np.pad(scene(name, frames), 4, constant_values=120) for frames in (VISIBLE, [*VISIBLE, *BEHIND])]
        )
        for name in ("independent", "chain")
    ]
    return np.vstack(rows)


def write_scene() -> None:
    """The scene of figures 8 and 9."""
    cv2.imwrite(str(IMAGES / "stereo-false-match.png"), false_match_scene())


def write_map(occupancy: OccupancyGrid | None, name: str, path: Trajectory) -> None:
    """A map with its trajectory."""
    assert occupancy is not None
    render_map(occupancy, path).save(IMAGES / name, optimize=True)


def main() -> None:
    """All pictures; the street's only where the real logs are."""
    write_scene()
    room = run_map(
        load_config("stereo-bayes", [], 0),
        REPOSITORY / "sample_logs" / "stereo-bayes.mcap",
        lambda p: None,
        lambda: False,
    )
    write_map(room.result.occupancy, "stereo-room.png", room.result.trajectory)
    data = data_dir()
    if data is None:
        return
    with tempfile.TemporaryDirectory() as scratch:
        log = write_street(data, Path(scratch) / "street")
        street = run_map(load_config("stereo-bayes", STREET, 0), log, lambda p: None, lambda: False)
    found, truth = street.result.trajectory.poses, true_path(data).poses
    length_m = np.hypot(*np.diff(truth[:, :2], axis=0).T).sum()
    say(
        f"street: end-point drift {100 * np.hypot(*(found[-1, :2] - truth[-1, :2])) / length_m:.2f} % of {length_m:.1f} m"
    )
    write_map(street.result.occupancy, "stereo-street.png", street.result.trajectory)


if __name__ == "__main__":
    main()
