"""Travel on the map is compared with travel by odometry."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.methods.ispace_mcl.travel_ratio import travel_ratio

N = 201
LOCALIZED = np.ones(N, np.bool_)


def drive(scale: float, noise_m: float = 0.03) -> tuple[np.ndarray, np.ndarray]:
    """Poses along a curve of 10 m with noise, and odometry of this scale in a frame of its own."""
    s = np.linspace(0.0, 10.0, N)
    path = np.column_stack([4.0 * np.sin(s / 4.0), 4.0 - 4.0 * np.cos(s / 4.0), s / 4.0])
    noise = np.random.default_rng(0).normal(0.0, noise_m, (N, 3))
    return path + noise, scale * path[:, [1, 0, 2]] + [7.0, -3.0, 0.0]


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_odometry_of_another_scale_is_found(scale: float) -> None:
    assert travel_ratio(*drive(scale), LOCALIZED) == pytest.approx(1.0 / scale, rel=0.05)


def test_good_odometry_gives_one() -> None:
    assert travel_ratio(*drive(0.95), LOCALIZED) == 1.0


def test_jumps_of_the_estimate_and_stretches_that_were_not_localized_do_not_count() -> None:
    poses, odometry = drive(1.0)
    poses[100:, 0] += 5.0
    assert travel_ratio(poses, odometry, LOCALIZED) == 1.0
    wrong, odometry = drive(0.8)
    assert travel_ratio(wrong, odometry, np.arange(N) < 50) == 1.0
    assert travel_ratio(wrong[:0], odometry[:0], LOCALIZED[:0]) == 1.0
