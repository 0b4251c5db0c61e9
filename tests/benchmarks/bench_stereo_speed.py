"""Speed of stereo-bayes, stage by stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from gridslam.core.messages import AbsolutePose, CameraInfo, Event, Odometry, StereoPair, Transform
from gridslam.methods.stereo_bayes.method import StereoBayes
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.stereo_trials import config_of

ALONE = True


def rows(frames: int = 20) -> Iterator[BenchmarkRow]:
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
        method.process(AbsolutePose(stamp, "map", np.array([0.01 * k, 0.0, 0.002 * k]), 1e-3 * np.eye(3)))
        method.process(replace(pair, stamp_ns=stamp))
    took = time.perf_counter() - started
    yield BenchmarkRow("stereo_bayes.speed.pairs", frames / took, "1/s")
    stages = {name: 1e3 * (method.timings_s[name] - before[name]) / frames for name in before}
    for name, ms in stages.items():
        yield BenchmarkRow(f"stereo_bayes.speed.{name}", ms, "ms")
    yield BenchmarkRow("stereo_bayes.speed.map_per_disparity", stages["map"] / stages["disparity"], "x", 0.5)


def stereo_head() -> Iterator[Event]:
    """Extrinsics and calibration of a head with 640 x 480 pixels."""
    yield Transform(0, "base_link", "optical", (0.0, 0.0, 0.6), (0.5, -0.5, 0.5, -0.5), is_static=True)
    K = np.array([[520.0, 0.0, 319.5], [0.0, 520.0, 239.5], [0.0, 0.0, 1.0]])
    for shift in (0.0, -520.0 * 0.12):
        P = np.column_stack([K, [shift, 0.0, 0.0]])
        yield CameraInfo(0, "optical", 640, 480, K, P, np.zeros(5))
