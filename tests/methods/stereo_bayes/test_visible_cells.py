"""Which cells count as visible."""

from __future__ import annotations

import numpy as np

from gridslam.methods.stereo_bayes.visible_cells import visible_cells

CAMERA = np.array([[10, 2]])


def room() -> tuple[np.ndarray, np.ndarray]:
    """A free room with a wall of three cells at column 20; all cells count as reached by rays."""
    probability = np.full((21, 40), 0.02)
    probability[:, 20:23] = 0.95
    return probability, np.ones(probability.shape, bool)


def test_free_cells_behind_a_wall_are_invisible() -> None:
    visible = visible_cells(*room(), CAMERA, near=3.0, surface=2.0)
    assert visible[:, :22].all()
    assert not visible[:, 23:].any()


def test_a_room_behind_an_open_door_is_visible() -> None:
    probability, reached = room()
    probability[9:12] = 0.02
    assert visible_cells(probability, reached, CAMERA, near=3.0, surface=2.0)[:, 23:].all()


def test_only_the_surface_of_an_obstacle_is_visible() -> None:
    probability, reached = room()
    probability[:, 20:] = 0.95
    visible = visible_cells(probability, reached, CAMERA, near=3.0, surface=2.0)
    assert visible[:, 20:22].all() and not visible[:, 22:].any()


def test_cells_that_no_ray_reached_are_invisible() -> None:
    probability, reached = room()
    reached[:5] = False
    assert not visible_cells(probability, reached, CAMERA, near=3.0, surface=2.0)[:5].any()
