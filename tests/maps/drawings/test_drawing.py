"""Drawings as people make them: what is wall, what is free, what is outside."""

from __future__ import annotations

import io
import struct
import zlib
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from gridslam.core.errors import ConfigError, MapError
from gridslam.maps.drawings.drawing import MAX_PIXELS, drawn_map, load_drawing

HEIGHT, WIDTH = 120, 200
ROOM = (slice(20, 100), slice(30, 170))  # rows from the top, columns: what lies within the strokes of `room`


def room(stroke: int = 2, gap: slice | None = None) -> np.ndarray:
    """A room in black on white; a gap is a range of columns missing from its upper wall."""
    picture = np.full((HEIGHT, WIDTH), 255, np.uint8)
    cv2.rectangle(picture, (30, 20), (169, 99), 0, stroke)
    if gap is not None:
        picture[15:26, gap] = 255
    return picture


def read(picture: np.ndarray, folder: Path, name: str = "drawing.png"):
    path = folder / name
    Image.fromarray(picture).save(path)
    return load_drawing(path)


def fractions_of_room(free: np.ndarray) -> tuple[float, float]:
    """Fraction of the room's interior that is free, and the free pixels outside of it as a fraction of the interior."""
    inside = np.zeros((HEIGHT, WIDTH), np.bool_)
    inside[24:96, 34:166] = True
    grown = np.zeros_like(inside)
    grown[ROOM] = True
    top_first = free[::-1]
    return float(top_first[inside].mean()), float((top_first & ~grown).sum() / inside.sum())


def assert_is_the_room(free: np.ndarray) -> None:
    within, without = fractions_of_room(free)
    assert within > 0.98
    assert without < 0.02


@pytest.mark.parametrize("stroke", [1, 2, 5, 11])
@pytest.mark.parametrize("inverted", [False, True])
def test_the_room_is_found_whatever_the_colours_and_the_pen(tmp_path, stroke, inverted):
    picture = room(stroke)
    drawn = drawn_map(read(255 - picture if inverted else picture, tmp_path))
    assert drawn.walls_are == ("bright" if inverted else "dark")
    assert not drawn.is_open
    within, without = fractions_of_room(drawn.free)
    assert within > (0.98 if stroke < 10 else 0.85)
    assert without < 0.02


def test_row_0_is_the_bottom(tmp_path):
    picture = room()
    picture[90:99, 60:64] = 0  # a peg on the lower wall, which is drawn in row 99 from the top
    drawn = drawn_map(read(picture, tmp_path))
    assert not drawn.free[HEIGHT - 1 - 95, 62]
    assert drawn.free[HEIGHT - 1 - 25, 62]


@pytest.mark.parametrize("ink", [0, 255])
def test_transparent_is_paper(tmp_path, ink):
    alpha = 255 - room()
    rgba = np.dstack([np.full((HEIGHT, WIDTH, 3), ink, np.uint8), alpha])
    assert_is_the_room(drawn_map(read(rgba, tmp_path)).free)


def test_compression_leaves_no_specks(tmp_path):
    rng = np.random.default_rng(0)
    noisy = np.clip(room(3) + rng.normal(0, 8, (HEIGHT, WIDTH)), 0, 255).astype(np.uint8)
    path = tmp_path / "drawing.jpg"
    Image.fromarray(noisy).save(path, quality=25)
    assert_is_the_room(drawn_map(load_drawing(path)).free)


@pytest.mark.parametrize("gap", [2, 3])
def test_small_gaps_in_strokes_are_closed(tmp_path, gap):
    picture = room()
    picture[30:99, 98:100] = 0  # an inner wall with a hiccup of the pen
    picture[60 : 60 + gap, 95:103] = 255
    drawn = drawn_map(read(picture, tmp_path), start_xy=(5.0, 6.0))
    walls = drawn.walls[::-1]
    assert walls[55:65, 96:102].any(axis=1).all()


@pytest.mark.parametrize("width", [8, 16])
@pytest.mark.parametrize("start", [None, (10.0, 6.0)])
def test_a_gap_in_the_contour_does_not_let_the_outside_in(tmp_path, width, start):
    drawn = drawn_map(read(room(gap=slice(90, 90 + width)), tmp_path), start_xy=start)
    within, without = fractions_of_room(drawn.free)
    assert not drawn.is_open
    assert within > 0.97
    assert without < 0.03
    assert drawn.walls[::-1][10:30, 90 : 90 + width].any(axis=0).all()


def test_doors_remain_open(tmp_path):
    picture = room()
    picture[20:99, 98:100] = 0
    picture[55:67, 95:103] = 255  # 1.2 m
    drawn = drawn_map(read(picture, tmp_path), start_xy=(5.0, 6.0))
    assert drawn.free[60, 60] and drawn.free[60, 140]


def test_without_a_border_the_free_space_ends_with_the_picture(tmp_path):
    picture = np.full((HEIGHT, WIDTH), 255, np.uint8)
    picture[40:42], picture[80:82] = 0, 0
    drawn = drawn_map(read(picture, tmp_path), start_xy=(10.0, 6.0))
    assert drawn.is_open
    assert drawn.free[50:70].all()
    assert not drawn.free[: HEIGHT - 83].any()


def test_a_filled_outside_is_wall(tmp_path):
    picture = np.zeros((HEIGHT, WIDTH), np.uint8)
    picture[22:98, 32:168] = 255
    drawn = drawn_map(read(picture, tmp_path))
    assert drawn.walls_are == "dark"
    assert_is_the_room(drawn.free)
    # Only the surface counts as wall: a scan that ends deep inside has not met it.
    assert drawn.walls.sum() < 600


def test_a_shaky_hand_does_not_matter(tmp_path):
    rng = np.random.default_rng(1)
    picture = np.full((HEIGHT, WIDTH), 255, np.uint8)
    corners = np.array([(30, 20), (169, 20), (169, 99), (30, 99), (30, 20)], float)
    for a, b in pairwise(corners):
        line = a + np.linspace(0, 1, 25)[:, None] * (b - a) + rng.normal(0, 0.8, (25, 2))
        cv2.polylines(picture, [np.rint(line).astype(np.int32)], False, 0, 2)
    within, without = fractions_of_room(drawn_map(read(picture, tmp_path)).free)
    assert within > 0.97
    assert without < 0.03


@pytest.mark.parametrize("with_table", [False, True])
def test_a_photograph_with_a_shadow_is_read(tmp_path, with_table):
    rng = np.random.default_rng(2)
    picture = cv2.GaussianBlur(room(3), (0, 0), 0.7).astype(np.float64)
    ink = 60.0 + 150.0 * picture / 255.0
    rows, cols = np.mgrid[:HEIGHT, :WIDTH]
    shadow = 1.0 - 0.6 * np.exp(-((cols - 50.0) ** 2 + (rows - 90.0) ** 2) / 4000.0) - 0.2 * cols / WIDTH
    photo = ink * shadow + rng.normal(0.0, 3.0, ink.shape)
    if with_table:
        photo[rows < 8.0 - 0.05 * cols] = 30.0
    drawn = drawn_map(read(np.clip(photo, 0, 255).astype(np.uint8), tmp_path))
    assert drawn.walls_are == "dark"
    assert_is_the_room(drawn.free)


def test_the_configured_colour_wins(tmp_path):
    picture = np.full((HEIGHT, WIDTH), 255, np.uint8)
    picture[22:98, 32:168] = 0  # a dark block on paper: a pillar, or a room with a filled outside?
    assert drawn_map(read(picture, tmp_path), walls_are="dark").walls_are == "dark"
    assert_is_the_room(drawn_map(read(picture, tmp_path), walls_are="bright").free)


def test_what_is_no_picture_is_reported(tmp_path):
    path = tmp_path / "drawing.png"
    path.write_text("walls")
    with pytest.raises(MapError, match="not a readable picture"):
        load_drawing(path)


def test_a_cut_picture_is_reported(tmp_path):
    buffer = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (80, 80), np.uint8)).save(buffer, format="PNG")
    path = tmp_path / "drawing.png"
    path.write_bytes(buffer.getvalue()[:600])
    with pytest.raises(MapError, match=r"drawing\.png: not a readable picture"):
        load_drawing(path)


def test_one_colour_is_reported(tmp_path):
    with pytest.raises(MapError, match="only one colour"):
        read(np.full((100, 100), 200, np.uint8), tmp_path)


def test_absurd_sizes_are_refused(tmp_path):
    path = tmp_path / "drawing.png"
    side = int(MAX_PIXELS**0.5) + 10
    Image.new("1", (side, side)).save(path)
    with pytest.raises(MapError, match="pixels"):
        load_drawing(path)
    content = bytearray(path.read_bytes())
    content[16:24] = struct.pack(">II", 100_000, 100_000)
    content[29:33] = struct.pack(">I", zlib.crc32(bytes(content[12:29])))
    path.write_bytes(bytes(content))
    with pytest.raises(MapError, match=r"draw it smaller|scale the drawing down"):
        load_drawing(path)
    with pytest.raises(MapError, match="too small for a drawing"):
        read(np.eye(8, dtype=np.uint8) * 255, tmp_path)


def test_a_start_outside_of_the_picture_is_reported(tmp_path):
    with pytest.raises(ConfigError, match=r"start \(30, 5\) lies outside .* 20 x 12 drawing"):
        drawn_map(read(room(), tmp_path), start_xy=(30.0, 5.0))


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["photo_mild.jpg", "photo_shadow.jpg", "faint_pencil.jpg", "clean.jpg"])
def test_photographs_of_a_drawing_are_read_like_the_drawing(cases_dir, name):
    folder = cases_dir / "companion" / "drawings"
    clean, photo = (drawn_map(load_drawing(folder / file)) for file in ("clean.jpg", name))
    assert photo.walls_are == "dark"
    assert (clean.free & photo.free).sum() > 0.98 * (clean.free | photo.free).sum()


def test_a_tilted_photograph_on_a_dark_table_is_read(cases_dir):
    drawn = drawn_map(load_drawing(cases_dir / "companion" / "drawings" / "photo_skew_dark_table.jpg"))
    assert drawn.walls_are == "dark"
    assert 0.3 < drawn.free.mean() < 0.34


def test_drawings_by_people_enclose_a_place(data_dir):
    for path in sorted((data_dir / "sketches").glob("*.png")):
        drawn = drawn_map(load_drawing(path))
        assert drawn.walls_are == "bright", path.name
        assert not drawn.is_open, path.name
        assert 0.2 < drawn.free.mean() < 0.95, path.name


def test_a_drawing_that_is_not_there_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"nowhere\.png: No such file or directory$"):
        load_drawing(tmp_path / "nowhere.png")
