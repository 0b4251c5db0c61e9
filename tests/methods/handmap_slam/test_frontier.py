"""Frontiers of the observed space, and the tour over them."""

from __future__ import annotations

import numpy as np

from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.driving.frontier_tour import FrontierTour
from gridslam.methods.handmap_slam.driving.observed_grid import frontier_cells, frontier_gallery
from gridslam.methods.handmap_slam.scan_memory import BeamEndpoints


def room() -> tuple[np.ndarray, np.ndarray]:
    """30 x 40 free cells within walls that have an opening of ten cells at the right."""
    blocked = np.zeros((60, 80), bool)
    blocked[10:42, [10, 51]] = blocked[[10, 41], 10:52] = True
    free = np.zeros_like(blocked)
    free[11:41, 11:51] = True
    blocked[20:30, 51] = False
    free[20:30, 51:54] = True
    return free, blocked


def test_frontiers_lie_where_free_space_borders_on_unobserved_space() -> None:
    free, blocked = room()
    found = frontier_cells(free, blocked, 8)
    assert found[20:30, 54].all()
    assert not found[:, :51].any()
    assert not (found & (free | blocked)).any()


def test_short_frontiers_are_ignored() -> None:
    free, blocked = room()
    assert not frontier_cells(free, blocked, 20).any()


def test_gaps_between_beams_are_no_frontiers() -> None:
    free, blocked = room()
    free[15:38, 30:45:3] = False
    assert not frontier_cells(free, blocked, 8)[:, :50].any()


def test_a_corner_behind_a_box_is_visible_only_from_beside_the_box() -> None:
    free, blocked = room()
    blocked[20:30, 51] = True
    free[20:30, 51:54] = False
    free[20:31, 40:51] = False  # unobserved: the box itself and its shadow
    blocked[20:31, 40] = blocked[20, 40:46] = True
    frontier = frontier_cells(free, blocked, 2)
    gallery = frontier_gallery(frontier, free)
    in_front, beside_the_box = np.array([[20.5, 25.5], [48.5, 15.5]])
    visible = gallery.visible_from(np.array([in_front, beside_the_box]), 40.0)
    shadow = np.ravel_multi_index((20, 48), free.shape)
    assert frontier.ravel()[shadow]
    index = np.flatnonzero(gallery.cells == shadow)[0]
    assert visible[:, index].tolist() == [False, True]


def scan(open_from: float, open_to: float) -> BeamEndpoints:
    """720 beams of a robot in a round room of 3 m radius, open between two bearings."""
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    is_open = (bearings > open_from) & (bearings < open_to)
    ranges = np.where(is_open, 8.0, 3.0)
    endpoints = np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]
    return BeamEndpoints(0, np.zeros(2), endpoints, ~is_open)


def test_the_path_leads_to_the_open_side_and_a_closed_room_is_finished() -> None:
    tour = FrontierTour(ExplorationConfig())
    tour.observed.add(np.array([5.0, -3.0, 0.0]), scan(-0.4, 0.4))
    found = tour.path(0, np.array([5.0, -3.0, 0.0]), 0.25)
    assert np.isfinite(found.cost_m)
    # The sides of the opening lie beyond 3 m and are viewed from 4 m at most: a small step towards it shows more of them.
    assert 0.1 < found.path[-1, 0] < 5.0
    closed = FrontierTour(ExplorationConfig())
    closed.observed.add(np.zeros(3), scan(0.0, 0.0))
    assert not len(closed.path(0, np.zeros(3), 0.25).path)
    assert not closed.is_finished  # it waits for more scans first
    closed.path(3 * 10**9, np.zeros(3), 0.25)
    assert closed.is_finished


def test_a_viewpoint_that_gets_no_closer_is_abandoned() -> None:
    tour = FrontierTour(ExplorationConfig())
    tour.observed.add(np.zeros(3), scan(-0.2, 0.2))
    for second in range(0, 800, 4):
        tour.path(second * 10**9, np.zeros(3), 0.25)
    assert tour.abandoned >= 1
    assert tour.is_finished


def test_a_disabled_frontier_tour_is_finished() -> None:
    assert FrontierTour(ExplorationConfig(visit_frontiers=False)).is_finished
