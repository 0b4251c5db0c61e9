"""Which cells count as seen."""

from __future__ import annotations

import numpy as np

from gridslam.methods.stereo_bayes.seen import seen_cells

EYE = np.array([[10, 2]])


def room() -> tuple[np.ndarray, np.ndarray]:
    """A free room with a wall three cells thick at column 20; rays are said to have come everywhere."""
    probability = np.full((21, 40), 0.02)
    probability[:, 20:23] = 0.95
    return probability, np.ones(probability.shape, bool)


def test_what_a_false_match_showed_behind_a_wall_was_not_seen() -> None:
    seen = seen_cells(*room(), EYE, near=3.0, surface=2.0)
    assert seen[:, :22].all()
    assert not seen[:, 23:].any()


def test_through_a_door_the_room_behind_is_seen() -> None:
    probability, reached = room()
    probability[9:12] = 0.02
    assert seen_cells(probability, reached, EYE, near=3.0, surface=2.0)[:, 23:].all()


def test_of_an_obstacle_only_the_surface_is_seen() -> None:
    probability, reached = room()
    probability[:, 20:] = 0.95
    seen = seen_cells(probability, reached, EYE, near=3.0, surface=2.0)
    assert seen[:, 20:22].all() and not seen[:, 22:].any()


def test_where_no_ray_came_nothing_was_seen() -> None:
    probability, reached = room()
    reached[:5] = False
    assert not seen_cells(probability, reached, EYE, near=3.0, surface=2.0)[:5].any()
