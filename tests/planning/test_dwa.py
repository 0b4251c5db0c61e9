"""The Dynamic Window Approach (handmap-slam, paper section 5)."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.planning.dwa import Drive, Window, choose_speeds, reachable

DRIVE = Drive(0.25, 0.4, 0.6, 0.6, 1.2)
WINDOW = Window(0.1, 0.15, 11, 0.7, 0.04, 1.5, 1.0, 0.25, 0.35)
NOTHING = np.zeros((0, 2))


def test_the_window_holds_what_the_acceleration_allows_and_no_more() -> None:
    speeds = reachable((0.3, 0.4), DRIVE, WINDOW)
    assert np.abs(speeds - (0.3, 0.4)).max() <= 0.06 + 1e-9
    assert (np.abs(speeds[:, 1] - speeds[:, 0]) / 0.4 <= 1.2 + 1e-9).all()
    assert (reachable((0.6, 0.6), DRIVE, WINDOW) <= 0.6).all()


def test_in_the_open_the_robot_speeds_up_towards_its_target() -> None:
    now = (0.0, 0.0)
    for _ in range(15):
        choice = choose_speeds(now, np.array([3.0, 0.0]), NOTHING, DRIVE, WINDOW)
        now = choice.left_mps, choice.right_mps
    assert now == pytest.approx((0.6, 0.6), abs=0.01)


def test_it_turns_towards_a_target_at_its_side() -> None:
    choice = choose_speeds((0.2, 0.2), np.array([0.5, 2.0]), NOTHING, DRIVE, WINDOW)
    assert choice.right_mps > choice.left_mps


@pytest.mark.parametrize("seed", range(8))
def test_whatever_it_chooses_it_can_stop_before_it_touches(seed: int) -> None:
    """Drive among random points as the simulator would, each command taking effect a tenth of a second later."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((0.8, -1.5), (5.0, 1.5), (25, 2))
    x = y = yaw = 0.0
    now, nearest = (0.0, 0.0), np.inf
    for _ in range(300):
        cos, sin = np.cos(yaw), np.sin(yaw)
        local = (points - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
        target = (np.array([6.0, 0.0]) - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
        choice = choose_speeds(now, target, local, DRIVE, WINDOW)
        before, now = now, (choice.left_mps, choice.right_mps)
        for k in range(10):
            left, right = (b + (n - b) * (k + 1) / 10 for b, n in zip(before, now, strict=True))
            forward, turn = 0.5 * (left + right), (right - left) / DRIVE.base_m
            x, y = x + 0.01 * forward * np.cos(yaw), y + 0.01 * forward * np.sin(yaw)
            yaw += 0.01 * turn
            nearest = min(nearest, float(np.hypot(*(points - (x, y)).T).min()))
    assert nearest > DRIVE.radius_m


def test_before_a_wall_it_stops() -> None:
    wall = np.column_stack([np.full(40, 0.34), np.linspace(-1.0, 1.0, 40)])
    choice = choose_speeds((0.3, 0.3), np.array([2.0, 0.0]), wall, DRIVE, WINDOW)
    assert (choice.left_mps, choice.right_mps) == pytest.approx((0.24, 0.24))
