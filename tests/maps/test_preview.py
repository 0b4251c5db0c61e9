from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.picture.cells import Tint
from gridslam.maps.picture.ink import END, FREE, LOOP, PATH, START, UNKNOWN, UNTRUSTED, WALL
from gridslam.maps.picture.sheet import tick_step_m
from gridslam.maps.picture.window import choose_windows
from gridslam.maps.preview import PathMarks, render_map


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
    """Mean (column, row) of the pixels of exactly this colour above the legend."""
    rows, cols = np.nonzero((pixels[: int(0.8 * len(pixels))] == colour).all(axis=-1))
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


def test_a_tint_colours_the_floor_of_its_cells_and_no_wall() -> None:
    grid = room()
    opacity = np.zeros((30, 40), np.float32)
    opacity[:, 20:] = 1.0
    colour = (200, 100, 50)
    pixels = np.asarray(render_map(grid, tints=[Tint(lambda *part: opacity[part], colour, "seen")]))
    assert centre_of(pixels, colour)[0] > centre_of(pixels, FREE)[0]
    walls = (np.asarray(render_map(grid)) == WALL).all(axis=-1)[: int(0.8 * len(pixels))]
    assert ((pixels[: len(walls)] == WALL).all(axis=-1) == walls).all()


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


def has(pixels: np.ndarray, colour: tuple[int, int, int]) -> bool:
    return bool((pixels == colour).all(axis=-1).any())


def test_a_long_map_is_divided_into_rows_or_columns() -> None:
    cells = np.full((100, 4000), 0.0, np.float32)
    cells[[0, -1]] = 1.0
    corridor = OccupancyGrid(cells, GridGeometry(0.05, (0.0, 0.0)))
    upright = OccupancyGrid(np.ascontiguousarray(cells.T), GridGeometry(0.05, (0.0, 0.0)))
    for grid in (corridor, upright):
        width, height = render_map(grid).size
        assert 0.4 < width / height < 2.5
        windows = choose_windows(grid, np.zeros((0, 2)))
        assert len(windows) > 2
    columns = [(w.col0, w.col1) for w in choose_windows(corridor, np.zeros((0, 2)))]
    assert all(first[1] >= second[0] for first, second in pairwise(columns))


def test_readings_far_outside_are_left_out_and_long_rooms_are_not() -> None:
    cells = np.full((400, 1000), np.nan, np.float32)
    cells[100:300, 100:300] = 0.0
    plain = choose_windows(OccupancyGrid(cells.copy(), GridGeometry(0.05, (0.0, 0.0))), np.zeros((0, 2)))
    cells[200, 990] = 1.0
    grid = OccupancyGrid(cells, GridGeometry(0.05, (0.0, 0.0)))
    assert choose_windows(grid, np.zeros((0, 2))) == plain
    assert choose_windows(grid, np.array([[25.0, 10.0]]))[-1].col1 > 500  # the path went there
    cells[190:210, 300:990] = 0.0
    assert choose_windows(grid, np.zeros((0, 2)))[-1].col1 > 980


def test_marks_on_the_path_are_drawn_and_named() -> None:
    walked = path(*((0.1 * k, 0.0) for k in range(20)))
    plain = np.asarray(render_map(room(), walked))
    assert not any(has(plain, colour) for colour in (UNTRUSTED, LOOP))
    marks = PathMarks(np.arange(20) > 10, np.full(20, 0.2), np.array([[[0.0, 0.0], [0.5, 0.5]]]))
    pixels = np.asarray(render_map(room(), walked, marks=marks))
    assert has(pixels, UNTRUSTED)
    assert has(pixels, LOOP)


def test_a_lost_robot_that_is_found_elsewhere_has_not_driven_there() -> None:
    jumped = path((-0.8, -1.3), (-0.7, -1.3), (2.7, 1.2), (2.8, 1.2))
    untrusted = PathMarks(np.array([True, True, False, False]))
    line = np.asarray(render_map(room(), jumped)).astype(int)
    interrupted = np.asarray(render_map(room(), jumped, marks=untrusted)).astype(int)
    middle = centre_of(line.astype(np.uint8), START), centre_of(line.astype(np.uint8), END)
    col, row = ((middle[0] + middle[1]) / 2).astype(int)
    assert (line[row - 3 : row + 4, col - 3 : col + 4] == PATH).all(axis=-1).any()
    assert not (interrupted[row - 3 : row + 4, col - 3 : col + 4] == PATH).all(axis=-1).any()


def test_a_grid_of_lines_is_drawn_when_asked() -> None:
    plain, ruled = (np.asarray(render_map(room(), with_grid=on)) for on in (False, True))
    assert (plain[:800] == FREE).all(axis=-1).sum() > (ruled[:800] == FREE).all(axis=-1).sum() + 1000


@pytest.mark.parametrize(("px_per_m", "step"), [(10.0, 10.0), (24.0, 5.0), (1000.0, 0.1), (0.5, 200.0)])
def test_ticks_are_round_and_far_enough_apart(px_per_m: float, step: float) -> None:
    assert tick_step_m(px_per_m, 16) == pytest.approx(step)
    assert step * px_per_m >= 5 * 16


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
