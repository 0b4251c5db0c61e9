"""Which poses are paired, and what lies between two of them."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.association import Pairs, associate

SECOND = 1_000_000_000


def along_x(*stamps_s: float) -> Trajectory:
    """A robot that drives along x at 1 m/s: its x is its stamp."""
    stamps = np.array(stamps_s)
    return Trajectory(np.round(stamps * SECOND).astype(np.int64), np.outer(stamps, [1.0, 0.0, 0.0]))


def paired_x(pairs: Pairs) -> list[float]:
    assert np.allclose(pairs.estimate, pairs.truth)
    return pairs.truth[:, 0].round(6).tolist()


def test_a_pose_between_two_neighbours_is_interpolated_however_far_the_nearer_is() -> None:
    estimate, truth = along_x(0.25, 0.5, 1.1), along_x(0.0, 0.6, 1.2, 1.3)
    assert paired_x(associate(estimate, truth, "interpolate")) == [0.25, 0.5, 1.1]
    assert paired_x(associate(truth, estimate, "interpolate")) == [0.25, 0.5, 1.1]


def test_nothing_is_interpolated_over_a_wider_gap_nor_beyond_the_ends() -> None:
    estimate, truth = along_x(-0.1, 0.5, 1.5, 3.0, 4.001), along_x(0.0, 1.0, 3.0, 3.5, 3.8, 4.0)
    assert paired_x(associate(estimate, truth, "interpolate")) == [0.5, 3.0]
    assert paired_x(associate(estimate, truth, "interpolate", max_gap_ns=2 * SECOND)) == [0.5, 1.5, 3.0]


@pytest.mark.parametrize(("largest_s", "expected"), [(0.2, [0.8]), (0.1, [])])
def test_with_a_largest_difference_the_nearer_neighbour_must_be_near_too(
    largest_s: float, expected: list[float]
) -> None:
    estimate, truth = along_x(0.5, 0.8), along_x(0.0, 1.0, 2.0)
    pairs = associate(estimate, truth, "interpolate", round(largest_s * SECOND))
    assert paired_x(pairs) == expected
