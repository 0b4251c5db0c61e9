"""KITTI's errors: those of its development kit, written out slowly; and drifts whose errors are known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.evaluation.kitti_errors import LENGTHS_M, START_STEP, kitti_errors


def drive(n: int = 1500) -> np.ndarray:
    rng = np.random.default_rng(1)
    steps = np.column_stack([rng.uniform(0.4, 0.8, n), np.zeros(n), rng.normal(0.0, 0.01, n)])
    path = [np.zeros(3)]
    for step in steps:
        path.append(se2.compose(path[-1], step))
    return np.array(path)


def noisy(truth: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(2)
    path = [truth[0]]
    for a, b in pairwise(truth):
        path.append(se2.compose(path[-1], se2.between(a, b) * [1.01, 1, 1] + rng.normal(0, 0.002, 3)))
    return np.array(path)


def reference(estimate: np.ndarray, truth: np.ndarray) -> tuple[float, float, int]:
    """The loops of the development kit (`calcSequenceErrors`)."""
    distance = [0.0]
    for a, b in pairwise(truth):
        distance.append(distance[-1] + float(np.hypot(*(b - a)[:2])))
    translation, rotation = [], []
    for first in range(0, len(truth), START_STEP):
        for length in LENGTHS_M:
            last = next((i for i in range(first, len(truth)) if distance[i] > distance[first] + length), None)
            if last is None:
                continue
            error = se2.between(
                se2.between(estimate[first], estimate[last]), se2.between(truth[first], truth[last])
            )
            translation.append(float(np.hypot(error[0], error[1])) / length)
            rotation.append(abs(float(error[2])) / length)
    return float(np.mean(translation)), float(np.mean(rotation)), len(translation)


def test_the_errors_are_those_of_the_development_kit() -> None:
    truth = drive()
    estimate = noisy(truth)
    found = kitti_errors(estimate, truth)
    translation, rotation, count = reference(estimate, truth)
    assert found is not None
    assert found.count == count
    assert found.t_rel_percent == pytest.approx(100.0 * translation, rel=1e-9)
    assert found.r_rel_deg_per_100m == pytest.approx(100.0 * np.degrees(rotation), rel=1e-9)


def test_a_scale_error_of_one_percent_on_a_straight_road_is_one_percent() -> None:
    truth = np.column_stack([np.arange(2000) * 0.5, np.zeros(2000), np.zeros(2000)])
    found = kitti_errors(truth * [1.01, 1, 1], truth)
    assert found is not None
    assert found.t_rel_percent == pytest.approx(1.0, rel=0.01)
    assert found.r_rel_deg_per_100m == 0.0


@pytest.mark.parametrize("count", [0, 1, 150])
def test_a_path_below_a_hundred_metres_has_no_such_errors(count: int) -> None:
    truth = np.column_stack([np.arange(count) * 0.5, np.zeros(count), np.zeros(count)])
    assert kitti_errors(truth, truth) is None
