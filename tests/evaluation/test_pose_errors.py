from __future__ import annotations

import numpy as np
import pytest

from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.association import Pairs
from gridslam.evaluation.pose_errors import Delta, absolute_errors, relative_errors
from gridslam.evaluation.statistics import statistics


def test_seconds_choose_the_pairs_that_far_apart() -> None:
    stamps = np.array([0, 500, 1000, 1450, 2050, 3000]) * 1_000_000
    along = np.arange(6.0)
    truth = np.column_stack([along, np.zeros(6), np.zeros(6)])
    estimate = np.column_stack([along * 1.1, np.zeros(6), np.zeros(6)])
    pairs = Pairs(stamps, estimate, truth)
    # 0 -> 1 s, 1 -> 2.05 s; 3 s is only 0.95 s later
    assert relative_errors(pairs, Delta(1.0, "seconds")).translation_m == pytest.approx([0.2, 0.2])
    # within 10 %: 0 -> 1, 0.5 -> 1.45, 1 -> 2.05 and 2.05 -> 3 s; 1.45 s has none
    assert len(relative_errors(pairs, Delta(1.0, "seconds", all_pairs=True)).translation_m) == 4


def test_a_half_turn_is_180_degrees_and_no_more() -> None:
    errors = absolute_errors(np.array([[0.0, 0.0, 3.0]]), np.array([[0.0, 0.0, 3.0 - np.pi]]))
    assert errors.rotation_deg == pytest.approx([180.0])


def test_alignment_recovers_the_motion_between_two_frames() -> None:
    rng = np.random.default_rng(1)
    estimate = np.column_stack([rng.normal(size=(9, 2)), rng.uniform(-3, 3, 9)])
    turned = estimate[:, :2] @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    truth = np.column_stack([2.0 * turned + [3.0, -4.0], estimate[:, 2] + np.pi / 2])
    found = find_alignment(estimate, truth, "se2", with_scale=True)
    assert found is not None
    assert [*found.T_truth_estimate, found.scale] == pytest.approx([3.0, -4.0, np.pi / 2, 2.0])


def test_a_straight_line_can_be_aligned_and_a_robot_that_stands_still_cannot() -> None:
    line = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    assert find_alignment(line, line, "se2") is not None
    assert find_alignment(line * 0.0, line, "se2") is None
    assert find_alignment(line, line * 0.0, "se2") is None


def test_no_errors_have_no_statistics() -> None:
    assert all(np.isnan(v) for v in statistics(np.zeros(0)).values())
