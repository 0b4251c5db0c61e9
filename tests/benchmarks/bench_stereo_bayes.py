"""stereo-bayes in simulated rooms: the three likelihoods and a plain inverse sensor model, at growing rates of false matches.

20 rooms (seeds 0 to 19; 100 and up were used for tuning) of 60 frames each. Log-loss and IoU are taken over the cells that some
frame could see.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import sqrt

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from gridslam.core.messages import CameraInfo, Event, Odometry, PoseFix, StereoPair, Transform
from gridslam.methods.stereo_bayes.belief import BeliefMap, Rays
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.method import StereoBayes
from gridslam.run_config import load_run_config
from gridslam.sensors.stereo_head import UNKNOWN, ColumnSettings, measured_columns
from tests.benchmarks.harness import Row, say
from tests.benchmarks.stereo_rooms import CELL_M, Room, Truth, disparity_of, head, room_of, truth_of

Floats = NDArray[np.float64]

SEEDS = range(int(os.environ.get("GRIDSLAM_BENCH_SEEDS", "20")))
FALSE_SHARES = (0.0, 0.05, 0.1, 0.2)
LIKELIHOODS = ("independent", "occlusion", "chain")
LOG_ODDS = (0.85, -0.4)  # of a plain inverse sensor model
POSE_NOISE = (0.05, 0.05, np.radians(2.0))


@dataclass(frozen=True, slots=True)
class Score:
    """Mean log-loss (nats) and IoU over the cells that could be seen; how often a sure obstacle was lost (cells times frames)."""

    log_loss: float
    iou: float
    lost: int


def rows() -> Iterator[Row]:
    """Each figure's mean over the rooms; the intervals on stderr."""
    for share in FALSE_SHARES:
        scores = {name: [] for name in (*LIKELIHOODS, "log-odds")}
        for seed in SEEDS:
            for name, score in scores_of(seed, share).items():
                scores[name].append(score)
        yield from rows_of(share, scores)
    yield from blur_rows()
    yield from speed_rows()


def rows_of(share: float, scores: Mapping[str, list[Score]]) -> Iterator[Row]:
    """One rate of false matches."""
    label = f"stereo_bayes.false_{round(100 * share):02d}"
    chain = [s.log_loss for s in scores["chain"]]
    for name, found in scores.items():
        losses, ious = [s.log_loss for s in found], [s.iou for s in found]
        lost = sum(s.lost for s in found)
        worse = np.subtract(losses, chain)
        low, high = mean_interval(worse)
        say(
            f"{label} {name}: log-loss {np.mean(losses):.4f}, IoU {np.mean(ious):.3f}, lost {lost}; "
            f"log-loss less the chain's {np.mean(worse):+.4f} [{low:+.4f}, {high:+.4f}]"
        )
        yield Row(f"{label}.{name}.log_loss", float(np.mean(losses)), "nat")
        yield Row(f"{label}.{name}.iou", float(np.mean(ious)), "")
        yield Row(f"{label}.{name}.lost_obstacles", float(lost), "cell frames")
        if name != "chain" and share >= 0.05:
            yield Row(f"{label}.{name}.worse_than_chain", low, "nat", 0.0, at_least=True)


def blur_rows() -> Iterator[Row]:
    """Poses with errors of 5 cm and 2 degrees, with the likelihoods averaged over the pose and without."""
    losses: dict[bool, list[float]] = {True: [], False: []}
    for seed in SEEDS:
        for blur in losses:
            config = config_of(f"method.pose.blur={str(blur).lower()}")
            losses[blur].append(score_of(seed, 0.05, config, noisy=True).log_loss)
    worse = np.subtract(losses[False], losses[True])
    low, high = mean_interval(worse)
    say(f"stereo_bayes.blur: log-loss without less with {worse.mean():+.4f} [{low:+.4f}, {high:+.4f}]")
    yield Row("stereo_bayes.blur.with.log_loss", float(np.mean(losses[True])), "nat")
    yield Row("stereo_bayes.blur.without.log_loss", float(np.mean(losses[False])), "nat")
    yield Row("stereo_bayes.blur.gain", low, "nat", 0.0, at_least=True)
    alone = "method.correlation.across_rays=0"
    for name, setting in {
        "adaptive": "method.correlation.mode=adaptive",
        "across_rays": "method.correlation.across_rays=1",
    }.items():
        config = config_of(alone, setting)
        gains = [
            score_of(s, 0.1, config_of(alone)).log_loss - score_of(s, 0.1, config).log_loss for s in SEEDS
        ]
        low, high = mean_interval(np.array(gains))
        say(f"stereo_bayes.{name}: gain over the plain chain {np.mean(gains):+.4f} [{low:+.4f}, {high:+.4f}]")
        yield Row(f"stereo_bayes.{name}.gain", float(np.mean(gains)), "nat")


def speed_rows(frames: int = 20) -> Iterator[Row]:
    """The whole pipeline on pairs of 640 x 480: pairs a second, and the stages beside OpenCV's matching in the same run."""
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.integers(0, 255, (480, 800)).astype(np.uint8), (0, 0), 1.2)
    pair = StereoPair(0, "optical", texture[:, 60:700].copy(), texture[:, 80:720].copy())
    method = StereoBayes(config_of(), 0)
    for event in stereo_head():
        method.process(event)
    for k in range(-3, frames):  # the first ones warm up
        if k == 0:
            started, before = time.perf_counter(), dict(method.timings_s)
        stamp = 10**9 + (k + 3) * 10**8
        method.process(Odometry(stamp, "odom", 0.01 * k, 0.0, 0.002 * k))
        method.process(PoseFix(stamp, "map", np.array([0.01 * k, 0.0, 0.002 * k]), 1e-3 * np.eye(3)))
        method.process(replace(pair, stamp_ns=stamp))
    took = time.perf_counter() - started
    yield Row("stereo_bayes.speed.pairs", frames / took, "1/s")
    stages = {name: 1e3 * (method.timings_s[name] - before[name]) / frames for name in before}
    for name, ms in stages.items():
        yield Row(f"stereo_bayes.speed.{name}", ms, "ms")
    yield Row("stereo_bayes.speed.map_per_disparity", stages["map"] / stages["disparity"], "x", 0.5)


def stereo_head() -> Iterator[Event]:
    """Mounting and calibration of a head with 640 x 480 pixels, and a first pose."""
    yield Transform(0, "base_link", "optical", (0.0, 0.0, 0.6), (0.5, -0.5, 0.5, -0.5), is_static=True)
    K = np.array([[520.0, 0.0, 319.5], [0.0, 520.0, 239.5], [0.0, 0.0, 1.0]])
    for shift in (0.0, -520.0 * 0.12):
        P = np.column_stack([K, [shift, 0.0, 0.0]])
        yield CameraInfo(0, "optical", 640, 480, K, P, np.zeros(5))


def config_of(*overrides: str) -> StereoBayesConfig:
    """The best settings with some of them changed."""
    config = load_run_config("stereo-bayes", overrides).method
    assert isinstance(config, StereoBayesConfig)
    return config


def scores_of(seed: int, share: float) -> dict[str, Score]:
    """All likelihoods on the same images, and the plain model."""
    found = {name: score_of(seed, share, config_of(f"method.likelihood={name}")) for name in LIKELIHOODS}
    found["log-odds"] = score_of(seed, share, None)
    return found


_TRUTHS: dict[int, tuple[Room, Truth]] = {}


def score_of(seed: int, share: float, config: StereoBayesConfig | None, noisy: bool = False) -> Score:
    """One map; `config` None is the plain inverse sensor model."""
    if seed not in _TRUTHS:
        room = room_of(seed)
        _TRUTHS[seed] = room, truth_of(room)
    room, truth = _TRUTHS[seed]
    rng = np.random.default_rng([seed, round(1000 * share)])
    mapper = Mapper(config or config_of(), is_plain=config is None)
    covariance = np.diag(np.square(POSE_NOISE)) if noisy else np.diag([1e-6] * 3)
    surface = truth.occupied & truth.seen
    sure, lost = np.zeros(surface.shape, bool), 0
    for pose in room.poses:
        image = disparity_of(room, pose, share, rng)
        believed = pose + (rng.normal(0.0, POSE_NOISE) if noisy else 0.0)
        mapper.take(image, believed, covariance)
        p = mapper.probability(truth)
        lost += int((sure & surface & (p < 0.5)).sum())
        sure = (sure & (p >= 0.5)) | (p > 0.9)
    p = np.clip(mapper.probability(truth), 1e-3, 1.0 - 1e-3)
    loss = -np.where(truth.occupied, np.log(p), np.log(1.0 - p))[truth.seen].mean()
    occupied = (p > 0.5) & truth.seen
    iou = (occupied & truth.occupied).sum() / max((occupied | (truth.occupied & truth.seen)).sum(), 1)
    return Score(float(loss), float(iou), lost)


class Mapper:
    """Images to a map: stereo-bayes, or log-odds of a plain inverse sensor model over the same rays."""

    def __init__(self, config: StereoBayesConfig, is_plain: bool) -> None:
        self._map = BeliefMap(config)
        self._is_plain = is_plain
        o = config.observation
        self._columns = ColumnSettings(
            o.bin_px, o.low_m, o.high_m, o.least_height_m, o.least_share, o.pick == "nearest", 64.0
        )
        self._head = head()
        self._log_odds = np.zeros((0, 0))

    def take(self, image: NDArray[np.float32], pose: Floats, covariance: Floats) -> None:
        """One frame."""
        columns = measured_columns(image, self._head, self._columns)
        told = columns.status != UNKNOWN
        order = np.argsort(columns.bearings[told], kind="stable")
        bearings = np.ascontiguousarray(columns.bearings[told][order])
        disparities = columns.disparities_px[told][order]
        if self._is_plain:
            self._take_plain(bearings, disparities, pose)
            return
        edges = self._head.depths(bearings, self._map.edges_m, 0.5)
        focal_baseline = self._head.focal_px * self._head.baseline_m
        rays = Rays(bearings, disparities, edges, np.zeros(2), focal_baseline)
        self._map.update(pose, covariance, rays, self._map.noise(64.0))

    def _take_plain(self, bearings: Floats, disparities: Floats, pose: Floats) -> None:
        """Every cell before the measured range is freer, those at it more occupied; one ray a cell, as in the method."""
        if not self._log_odds.size:
            self._log_odds = np.zeros((600, 600))
        depth = self._head.focal_px * self._head.baseline_m / disparities
        ranges = np.where(np.isnan(depth), 10.0, depth / np.cos(bearings))
        row, col = np.mgrid[:600, :600]
        x, y = (col + 0.5) * CELL_M - 12.0 - pose[0], (row + 0.5) * CELL_M - 12.0 - pose[1]
        away = np.hypot(x, y)
        off = (np.arctan2(y, x) - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
        k = np.clip(np.searchsorted(bearings, off), 0, len(bearings) - 1)
        inside = (np.abs(off - bearings[k]) < 0.02) & (away > 0.3) & (away < 10.0)
        at = inside & (np.abs(away - ranges[k]) <= 0.5 * CELL_M) & ~np.isnan(depth)[k]
        before = inside & (away < ranges[k] - 0.5 * CELL_M)
        self._log_odds = np.clip(self._log_odds + LOG_ODDS[0] * at + LOG_ODDS[1] * before, -6.0, 6.0)

    def probability(self, truth: Truth) -> Floats:
        """P of the truth's cells."""
        rows, cols = truth.occupied.shape
        if self._is_plain:
            first = round(12.0 / CELL_M)
            r, c = truth.corner[0] + first, truth.corner[1] + first
            return np.asarray(1.0 / (1.0 + np.exp(-self._log_odds[r : r + rows, c : c + cols])))
        layer = self._map.layer()
        corner = np.rint(np.array(layer.geometry.origin_xy_m) / CELL_M).astype(int)
        r, c = truth.corner[0] - corner[1], truth.corner[1] - corner[0]
        return np.asarray(layer.values[r : r + rows, c : c + cols], np.float64)


def mean_interval(values: Floats) -> tuple[float, float]:
    """95 % interval of the mean of independent values, by Student's t."""
    half = float(student.ppf(0.975, len(values) - 1)) * float(np.std(values, ddof=1)) / sqrt(len(values))
    return float(np.mean(values)) - half, float(np.mean(values)) + half
