from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.preview import END, FREE, PATH, START, UNKNOWN, WALL, render_map


def room(rows: int = 30, cols: int = 40, resolution_m: float = 0.1) -> OccupancyGrid:
    """Free, with a wall around it and one wall cell in the upper left quarter."""
    cells = np.zeros((rows, cols), np.float32)
    cells[[0, -1]] = cells[:, [0, -1]] = 1.0
    cells[3 * rows // 4, cols // 4] = 1.0
    return OccupancyGrid(cells, GridGeometry(resolution_m, (-1.0, -1.5)))


def path(*xy: tuple[float, float]) -> Trajectory:
    poses = np.array([(x, y, 0.0) for x, y in xy]).reshape(-1, 3)
    return Trajectory(np.arange(len(poses), dtype=np.int64), poses)


def centre_of(pixels: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Mean (column, row) of the pixels of exactly this colour."""
    rows, cols = np.nonzero((pixels == colour).all(axis=-1))
    assert len(rows)
    return np.array([cols.mean(), rows.mean()])


def test_y_points_up_in_the_picture_and_the_path_lies_on_its_cells() -> None:
    pixels = np.asarray(render_map(room(), path((-0.5, -1.0), (2.5, 1.0))))
    start, end = centre_of(pixels, START), centre_of(pixels, END)
    assert start[0] < end[0]
    assert start[1] > end[1]
    scale = (end[0] - start[0]) / 3.0
    assert start[1] - end[1] == pytest.approx(2.0 * scale, abs=2.0)


def test_walls_free_and_unknown_have_their_colours() -> None:
    colours = set(map(tuple, np.asarray(render_map(room())).reshape(-1, 3).tolist()))
    assert {FREE, WALL, UNKNOWN} <= colours
    assert PATH not in colours


def test_the_same_input_gives_the_same_picture() -> None:
    one, other = (render_map(room(), path((0.0, 0.0), (1.0, 1.0)), title="a").tobytes() for _ in range(2))
    assert one == other


@pytest.mark.parametrize("shape", [(1, 1), (1, 5000), (4500, 3), (0, 0)])
def test_maps_of_any_shape_give_a_picture_of_limited_size(shape: tuple[int, int]) -> None:
    grid = OccupancyGrid(np.ones(shape, np.float32), GridGeometry(0.05, (0.0, 0.0)))
    picture = render_map(grid, path((0.0, 0.0)))
    assert 200 <= max(picture.size) <= 2200


def test_thin_walls_remain_when_a_large_map_is_shrunk() -> None:
    cells = np.zeros((5000, 5000), np.float32)
    cells[:, 2501] = 1.0
    pixels = np.asarray(render_map(OccupancyGrid(cells, GridGeometry(0.05, (0.0, 0.0)))))
    middle = pixels[pixels.shape[0] // 2]
    assert (middle == WALL).all(axis=-1).any()


def test_a_path_far_outside_or_not_finite_does_not_change_the_window() -> None:
    astray = path((0.0, 0.0), (1.0, 0.0), (1e9, 1e9), (np.nan, 0.0))
    assert max(render_map(room(), astray).size) <= 2200


def test_an_unknown_map_gives_a_picture_too() -> None:
    grid = OccupancyGrid(np.full((5, 5), np.nan, np.float32), GridGeometry(0.05, (0.0, 0.0)))
    assert render_map(grid, particles=np.zeros((3, 3)), points=np.ones((2, 2))).size[0] >= 200


def test_footprints_are_drawn_in_their_colour_at_their_positions() -> None:
    square = np.array([[0.0, 0.0], [0.6, 0.0], [0.6, 0.6], [0.0, 0.6]])
    colour = (30, 110, 200)
    pixels = np.asarray(render_map(room(), footprints=[(square, colour, "")])).astype(int)
    changed = np.abs(pixels - np.asarray(render_map(room())).astype(int)).sum(axis=-1) > 0
    rows, cols = np.nonzero(changed)
    plain = np.asarray(render_map(room(), points=np.array([[0.3, 0.3]]))).astype(int)
    dots = np.abs(plain - np.asarray(render_map(room())).astype(int)).sum(axis=-1) > 0
    np.testing.assert_allclose([rows.mean(), cols.mean()], [n.mean() for n in np.nonzero(dots)], atol=3.0)
    assert (pixels == colour).all(axis=-1).any()
