"""Looking at what was not seen yet."""

from __future__ import annotations

import numpy as np

from gridslam.methods.handmap_slam.frontier import FrontierTour, hidden_gallery, unseen_beside
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


def test_what_is_to_be_looked_at_lies_where_free_space_meets_what_was_never_seen() -> None:
    free, blocked = room()
    found = unseen_beside(free, blocked, 8)
    assert found[20:30, 54].all()
    assert not found[:, :51].any()
    assert not (found & (free | blocked)).any()


def test_short_borders_are_left_alone() -> None:
    free, blocked = room()
    assert not unseen_beside(free, blocked, 20).any()


def test_gaps_between_beams_are_no_borders() -> None:
    free, blocked = room()
    free[15:38, 30:45:3] = False
    assert not unseen_beside(free, blocked, 8)[:, :50].any()


def test_a_corner_behind_a_box_is_seen_past_the_box_only() -> None:
    free, blocked = room()
    blocked[20:30, 51] = True
    free[20:30, 51:54] = False
    free[20:31, 40:51] = False  # unseen: the box itself and the shadow behind it
    blocked[20:31, 40] = blocked[20, 40:46] = True
    hidden = unseen_beside(free, blocked, 2)
    gallery = hidden_gallery(hidden, free)
    before_the_box, past_the_box = np.array([[20.5, 25.5], [48.5, 15.5]])
    sees = gallery.seen_from(np.array([before_the_box, past_the_box]), 40.0)
    shadow = np.ravel_multi_index((20, 48), free.shape)
    assert hidden.ravel()[shadow]
    index = np.flatnonzero(gallery.cells == shadow)[0]
    assert sees[:, index].tolist() == [False, True]


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
    # The flanks of the opening are beyond 3 m and looked at from 4 m at most: a small step towards it shows more of them.
    assert 0.1 < found.way[-1, 0] < 5.0
    closed = FrontierTour(PathConfig(), FrontierConfig())
    closed.seen.add(np.zeros(3), scan(0.0, 0.0))
    assert not len(closed.way(0, np.zeros(3), 0.25).way)
    assert not closed.is_finished  # it looks again for a while
    closed.way(3 * 10**9, np.zeros(3), 0.25)
    assert closed.is_finished


def test_a_view_that_comes_no_nearer_is_given_up() -> None:
    tour = FrontierTour(PathConfig(), FrontierConfig(patience_s=5.0))
    tour.seen.add(np.zeros(3), scan(-0.2, 0.2))
    for second in range(200):
        tour.way(second * 10**9, np.zeros(3), 0.25)
    assert tour.given_up >= 1
    assert tour.is_finished


def test_where_it_is_off_nothing_is_looked_for() -> None:
    assert FrontierTour(PathConfig(), FrontierConfig(enabled=False)).is_finished
