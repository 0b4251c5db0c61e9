"""Trials of the stereo maps: the same rays for every model, and the errors of its map.

Two kinds of stages: rays cast into rooms with a known rate of false matches (`stereo_rooms`), and rendered drives, matched by
OpenCV and mapped from the filter's poses, with added false matches (`stereo_drives`).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import t as student

from gridslam.evaluation.map_errors import intersection_over_union, log_loss
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import RayReader, StereoRays
from gridslam.runs.run_config import load_config
from tests.benchmarks.map_samples import sample
from tests.benchmarks.stereo_drives import StereoDrive, drive_of, with_false_matches
from tests.benchmarks.stereo_models import BayesModel, InverseSensorModel, MapModel
from tests.benchmarks.stereo_rooms import (
    CELL_M,
    ROOM_M,
    StereoRoom,
    contours_of,
    disparity_of,
    head,
    room_of,
    truth_of,
)

Floats = NDArray[np.float64]

LIKELIHOODS = ("independent", "occlusion", "chain")
MODELS = (*LIKELIHOODS, "log-odds")
POSE_NOISE = (0.05, 0.05, np.radians(2.0))
CERTAIN, LOST = 0.9, 0.5
NEAR_M = 0.1  # cells this near to a contour belong to the obstacle


@dataclass(frozen=True, slots=True)
class Stage:
    """Frames of rays with pose and covariance, the true map (NaN: not scored), and the contours of the obstacles in pieces."""

    frames: list[tuple[StereoRays, Floats, Floats]]
    truth: OccupancyGrid
    contours: list[Floats]


@dataclass(frozen=True, slots=True)
class MapScore:
    """Mean log-loss (nats) and IoU over the truth's cells.

    Of the pieces of the contours, `certain` had a probability above 0.9 at some time; `lost` is the number of frames, summed over
    the pieces, in which one of these was below 0.5.
    """

    log_loss: float
    iou: float
    lost: int
    certain: int
    pieces: int


def config_of(*overrides: str) -> StereoBayesConfig:
    """The best settings with some of them changed."""
    config = load_config("stereo-bayes", overrides).method
    assert isinstance(config, StereoBayesConfig)
    return config


def model_of(name: str) -> MapModel:
    """A likelihood of the best settings, or the plain model."""
    return (
        InverseSensorModel(config_of())
        if name == "log-odds"
        else BayesModel(config_of(f"method.likelihood={name}"))
    )


def scores_of(stage: Stage) -> dict[str, MapScore]:
    """All models on the same rays."""
    return {name: score_of(stage, model_of(name)) for name in MODELS}


def score_of(stage: Stage, model: MapModel) -> MapScore:
    """One map."""
    watch = ObstacleTracker(stage)
    for rays, pose, covariance in stage.frames:
        model.update(rays, pose, covariance)
        watch.update(model.layer())
    layer = model.layer()
    loss, _ = log_loss(layer, stage.truth, np.zeros(3))
    iou = intersection_over_union(layer, stage.truth, np.zeros(3))
    return MapScore(loss, iou, watch.lost, int(watch.certain.sum()), len(watch.certain))


class ObstacleTracker:
    """Tracks the pieces of obstacles in the map; the probability of a piece is the largest of the cells near it."""

    def __init__(self, stage: Stage) -> None:
        cell = stage.truth.geometry.resolution_m
        every = np.vstack(stage.contours)
        low, high = every.min(axis=0) - NEAR_M, every.max(axis=0) + NEAR_M
        x, y = np.meshgrid(*(np.arange(a, b, cell) for a, b in zip(low, high, strict=True)))
        self._points = np.column_stack([x.ravel(), y.ravel()])
        tree = cKDTree(self._points)
        near = [np.unique(np.concatenate(tree.query_ball_point(p, NEAR_M))) for p in stage.contours]
        self._first = np.cumsum([0, *(len(b) for b in near[:-1])])
        self._near = np.concatenate(near).astype(np.int64)
        self.certain = np.zeros(len(near), bool)
        self.lost = 0

    def update(self, layer: OccupancyGrid) -> None:
        """Count the pieces after a frame."""
        p = np.nan_to_num(sample(layer, self._points), nan=0.0)
        probability = np.maximum.reduceat(p[self._near], self._first)
        self.lost += int((self.certain & (probability < LOST)).sum())
        self.certain |= probability > CERTAIN


def room_stage(seed: int, rate: float, noisy: bool = False) -> Stage:
    """Rays cast into a room; `noisy`: with errors of the pose, and their covariance."""
    room, truth, contours = _room(seed)
    rng = np.random.default_rng([seed, round(1000 * rate)])
    reader, frames = RayReader(config_of(), Counter()), []
    covariance = np.diag(np.square(POSE_NOISE)) if noisy else np.diag([1e-6] * 3)
    for pose in room.poses:
        disparity = disparity_of(room, pose, rate, rng)
        estimated = pose + (rng.normal(0.0, POSE_NOISE) if noisy else 0.0)
        frames.append((reader.read(disparity, head()), estimated, covariance))
    return Stage(frames, truth, contours)


@lru_cache(maxsize=32)
def _room(seed: int) -> tuple[StereoRoom, OccupancyGrid, list[Floats]]:
    room = room_of(seed)
    truth = truth_of(room)
    p = np.where(truth.visible, truth.occupied, np.nan).astype(np.float32)
    row, col = truth.corner
    geometry = GridGeometry(CELL_M, (col * CELL_M, row * CELL_M))
    return room, OccupancyGrid(p, geometry), contours_of((0.0, 0.0, *ROOM_M), room.boxes)


def drive_stage(number: int, rate: float, config: StereoBayesConfig | None = None) -> Stage:
    """A rendered drive with false matches in a fraction `rate` of its columns; `config` for the rays is the best by default."""
    drive = _drive(number)
    rng = np.random.default_rng([number, round(1000 * rate)])
    reader, frames = RayReader(config or config_of(), Counter()), []
    for frame, belief in drive.frames:
        disparity = with_false_matches(frame.disparity, rate, rng)
        frames.append((reader.read(disparity, frame.head), belief.pose, belief.covariance))
    return Stage(frames, drive.truth, drive.contours)


@lru_cache(maxsize=1)
def _drive(number: int) -> StereoDrive:
    return drive_of(number)


def mean_interval(values: Floats) -> tuple[float, float]:
    """95 % interval of the mean of independent values, by Student's t."""
    half = float(student.ppf(0.975, len(values) - 1)) * float(np.std(values, ddof=1)) / sqrt(len(values))
    return float(np.mean(values)) - half, float(np.mean(values)) + half
