"""Walls visible from points of a grid, and counts of beams per cell."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.grids.visibility import pass_beams
from gridslam.planning.art_gallery import gallery_of
from tests.reference import visibility as reference


def room() -> tuple[np.ndarray, np.ndarray]:
    """A room of 18 x 8 free cells with a wall across from below that leaves the upper half open."""
    walls = np.ones((10, 20), bool)
    walls[1:9, 1:19] = False
    walls[1:5, 10] = True
    return walls, ~walls


def test_walls_are_visible_unless_another_wall_hides_them() -> None:
    walls, free = room()
    gallery = gallery_of(walls, free)
    seen = gallery.visible_from(np.array([[4.5, 2.5]]), 100.0)[0]
    cell = {tuple(divmod(int(c), 20)): bool(s) for c, s in zip(gallery.cells, seen, strict=True)}
    assert cell[(2, 0)]  # the wall to its left
    assert cell[(9, 4)]
    assert cell[(3, 10)]  # the near side of the dividing wall
    assert not cell[(0, 15)]  # the bottom wall behind it
    assert not cell[(2, 19)]
    assert cell[(9, 12)]  # past its upper end


def test_the_maximum_range_limits_visibility() -> None:
    walls, free = room()
    gallery = gallery_of(walls, free)
    seen = gallery.visible_from(np.array([[4.5, 2.5]]), 4.0)[0]
    cells = np.column_stack(np.unravel_index(gallery.cells[seen], walls.shape)) + 0.5
    assert seen.any()
    assert (np.hypot(cells[:, 1] - 4.5, cells[:, 0] - 2.5) <= 4.0 + 0.5).all()


def test_only_walls_with_a_free_side_are_targets() -> None:
    walls = np.ones((7, 7), bool)
    walls[3, 3] = False
    assert len(gallery_of(walls, ~walls).cells) == 4


def test_beams_pass_free_cells_and_stop_before_surfaces() -> None:
    passed, hit = np.zeros((5, 20), np.uint16), np.zeros((5, 20), np.uint16)
    ends = np.array([[15.5, 2.5], [19.5, 4.5]])
    pass_beams(passed, hit, np.array([2.5, 2.5]), ends, np.array([True, False]), 100.0, 1.5, 3.0)
    assert passed[2, 3:13].all()
    assert not passed[2, 15]
    assert hit[2, 15] == 1 == hit.sum()
    assert passed[4, 17]


def test_neighbouring_endpoints_are_joined_by_a_surface_if_they_are_close() -> None:
    ends = np.array([[10.5, 0.5], [10.5, 5.5], [10.5, 14.5]])
    for joined, expected in ((6.0, 6), (4.0, 2)):
        passed, hit = np.zeros((20, 20), np.uint16), np.zeros((20, 20), np.uint16)
        pass_beams(passed, hit, np.array([1.0, 1.0]), ends, np.ones(3, bool), 100.0, 1.5, joined)
        assert (hit[:6, 10] > 0).sum() == expected
        assert not hit[7:14, 10].any()


@pytest.mark.parametrize("seed", range(4))
def test_visible_walls_equal_those_of_the_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls = rng.random((15, 18)) < 0.15
    gallery = gallery_of(walls, ~walls)
    row, col = np.argwhere(~walls)[rng.integers((~walls).sum())]
    place = col + rng.uniform(0.2, 0.8), row + rng.uniform(0.2, 0.8)
    seen = gallery.visible_from(np.array([place]), 9.0)[0]
    assert set(gallery.cells[seen].tolist()) == reference.visible_walls(walls, ~walls, place, 9.0)


@pytest.mark.parametrize("seed", range(4))
def test_beam_counts_equal_those_of_the_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    passed, hit = np.zeros((30, 40), np.uint16), np.zeros((30, 40), np.uint16)
    ends, origin = rng.uniform([-5.0, -5.0], [45.0, 35.0], (25, 2)), np.array([18.3, 14.6])
    arguments = (origin, ends, rng.random(25) < 0.7, 16.0, 1.5, 12.0)
    pass_beams(passed, hit, *arguments)
    expected = reference.passed_and_hit((30, 40), *arguments)
    np.testing.assert_array_equal(passed, expected[0])
    np.testing.assert_array_equal(hit, expected[1])
