"""Borders between seen and unseen space."""

from __future__ import annotations

import numpy as np

from gridslam.methods.handmap_slam.frontier import FrontierTour, borders
from gridslam.methods.handmap_slam.planning_config import FrontierConfig, PathConfig
from gridslam.methods.handmap_slam.seen_scans import SeenScan


def room() -> tuple[np.ndarray, np.ndarray]:
    """30 x 40 free cells within walls that have an opening of ten cells at the right."""
    blocked = np.zeros((60, 80), bool)
    blocked[10:42, [10, 51]] = blocked[[10, 41], 10:52] = True
    free = np.zeros_like(blocked)
    free[11:41, 11:51] = True
    blocked[20:30, 51] = False
    free[20:30, 51:54] = True
    return free, blocked


def test_the_border_is_where_free_space_meets_what_was_never_seen() -> None:
    free, blocked = room()
    found = borders(free, blocked, 8)
    assert found[20:30, 53].all()
    assert not found[:, :51].any()
    assert not (found & ~free).any()


def test_short_borders_are_left_alone() -> None:
    free, blocked = room()
    assert not borders(free, blocked, 20).any()


def test_gaps_between_beams_are_no_borders() -> None:
    free, blocked = room()
    free[15:38, 30:45:3] = False
    assert not borders(free, blocked, 8)[:, :50].any()


def scan(open_from: float, open_to: float) -> SeenScan:
    """720 beams about a robot in a round room of 3 m, open between two bearings."""
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    is_open = (bearings > open_from) & (bearings < open_to)
    ranges = np.where(is_open, 8.0, 3.0)
    ends = np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]
    return SeenScan(0, np.zeros(2), ends, ~is_open)


def test_the_way_leads_to_the_open_side_and_a_closed_room_is_done() -> None:
    tour = FrontierTour(PathConfig(), FrontierConfig())
    tour.seen.add(np.array([5.0, -3.0, 0.0]), scan(-0.4, 0.4))
    found = tour.way(0, np.array([5.0, -3.0, 0.0]), 0.25)
    assert np.isfinite(found.cost_m)
    assert found.way[-1, 0] > 2.5
    assert abs(np.arctan2(found.way[-1, 1], found.way[-1, 0])) < 0.6
    closed = FrontierTour(PathConfig(), FrontierConfig())
    closed.seen.add(np.zeros(3), scan(0.0, 0.0))
    assert not len(closed.way(0, np.zeros(3), 0.25).way)
    assert not closed.is_finished  # it looks again for a while
    closed.way(3 * 10**9, np.zeros(3), 0.25)
    assert closed.is_finished


def test_a_border_that_comes_no_nearer_is_given_up() -> None:
    tour = FrontierTour(PathConfig(), FrontierConfig(patience_s=5.0))
    tour.seen.add(np.zeros(3), scan(-0.2, 0.2))
    for second in range(200):
        tour.way(second * 10**9, np.zeros(3), 0.25)
    assert tour.given_up >= 1
    assert tour.is_finished


def test_where_it_is_off_nothing_is_looked_for() -> None:
    assert FrontierTour(PathConfig(), FrontierConfig(enabled=False)).is_finished
