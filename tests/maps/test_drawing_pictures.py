"""Pictures of drawings as people make them: each kind is read as the plan that it shows."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from gridslam.core.errors import MapError
from gridslam.maps.drawings.drawing import drawn_map, load_drawing
from gridslam.maps.drawings.drawing_marks import marks_of
from gridslam.maps.drawings.drawing_picture import PHOTOGRAPH_SIDE_PX
from gridslam.maps.drawings.drawing_sheet import find_sheet, flattened
from tests.maps.pictured_plans import KINDS, SHEET, iou_of, picture_of


@pytest.mark.parametrize("kind", KINDS)
def test_the_free_space_of_a_plan_is_read_from_a_picture_of_it(tmp_path: Path, kind: str) -> None:
    assert iou_of(picture_of(kind, 3, tmp_path)) > 0.93


def test_a_sheet_whose_shadow_is_darker_than_the_table_in_the_light_is_found(tmp_path: Path) -> None:
    assert iou_of(picture_of("table", 8, tmp_path)) > 0.93


def test_a_reading_says_what_was_done_and_what_was_ignored(tmp_path: Path) -> None:
    light = drawn_map(load_drawing(picture_of("light", 1, tmp_path).path)).reading
    assert light is not None and light.light_evened
    reading = drawn_map(load_drawing(picture_of("phone", 1, tmp_path).path)).reading
    assert reading is not None and reading.perspective_undone
    assert reading.texts > 0 and reading.arrows > 0
    assert reading.ignored.any()
    plain = drawn_map(load_drawing(picture_of("pen", 1, tmp_path).path)).reading
    assert plain is not None
    assert not plain.light_evened and not plain.perspective_undone
    assert (plain.texts, plain.arrows, plain.specks) == (0, 0, 0)


def test_a_sheet_keeps_its_proportions() -> None:
    corners = np.array([(200.0, 150.0), (1000.0, 150.0), (1000.0, 650.0), (200.0, 650.0)])
    picture = np.full((800, 1200), 60, np.uint8)
    cv2.fillConvexPoly(picture, corners.astype(np.int32), 230)
    cv2.rectangle(picture, (400, 300), (800, 500), 40, 4)
    found = find_sheet(picture)
    assert found is not None
    np.testing.assert_allclose(found, corners, atol=4.0)
    rows, cols = flattened(picture, found).shape
    assert cols / rows == pytest.approx(1.6, rel=0.02)


def test_a_room_in_a_filled_outside_is_no_sheet() -> None:
    picture = np.full((800, 1200), 20, np.uint8)
    picture[150:650, 200:1000] = 230
    assert find_sheet(picture) is None


def test_pillars_short_walls_and_dashed_walls_are_kept() -> None:
    strokes = np.zeros((600, 900), np.uint8)
    cv2.rectangle(strokes, (50, 50), (850, 550), 1, 3)
    cv2.rectangle(strokes, (200, 200), (225, 225), 1, cv2.FILLED)
    cv2.rectangle(strokes, (400, 200), (430, 230), 1, 3)
    cv2.line(strokes, (600, 200), (640, 200), 1, 3)
    for x in range(200, 500, 30):
        cv2.line(strokes, (x, 400), (x + 15, 400), 1, 3)
    marks = marks_of(strokes > 0, strokes > 0)
    assert not marks.ignored.any()


def test_letters_and_arrows_are_ignored_but_not_where_they_touch_a_wall() -> None:
    strokes = np.zeros((600, 900), np.uint8)
    cv2.rectangle(strokes, (50, 50), (850, 550), 1, 3)
    cv2.putText(strokes, "Lab 7", (300, 300), cv2.FONT_HERSHEY_SIMPLEX, 0.8, 1, 2)
    cv2.arrowedLine(strokes, (500, 400), (565, 355), 1, 2, tipLength=0.25)
    marks = marks_of(strokes > 0, strokes > 0)
    assert marks.texts == 4 and marks.arrows == 1
    assert not marks.ignored[45:56].any()
    touching = strokes.copy()
    cv2.line(touching, (532, 378), (532, 550), 1, 2)
    assert marks_of(touching > 0, touching > 0).arrows == 0


def test_large_photographs_are_reduced_and_large_painted_drawings_are_not(tmp_path: Path) -> None:
    rows, cols = SHEET
    page = np.full((2 * rows, 2 * cols), 230, np.uint8)
    cv2.rectangle(page, (300, 300), (1500, 1000), 40, 9)
    Image.fromarray(page).save(tmp_path / "painted.png")
    assert load_drawing(tmp_path / "painted.png").levels.shape == page.shape
    grain = np.random.default_rng(0).integers(0, 25, page.shape, dtype=np.uint8)
    Image.fromarray(page - grain).save(tmp_path / "photo.png", compress_level=1)
    assert max(load_drawing(tmp_path / "photo.png").levels.shape) == PHOTOGRAPH_SIDE_PX


def test_damaged_notes_of_a_camera_do_not_matter(tmp_path: Path) -> None:
    page = np.full((200, 300), 230, np.uint8)
    cv2.rectangle(page, (40, 40), (260, 160), 40, 3)
    Image.fromarray(page).save(tmp_path / "drawing.jpg", exif=b"Exif\0\0II*\0\xff\xff\xff\x7f")
    assert load_drawing(tmp_path / "drawing.jpg").size == (30.0, 20.0)


@pytest.mark.parametrize("seed", range(3))
def test_pictures_of_noise_end_with_a_reading_or_one_line(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = rng.integers(0, 256, (300, 400, 3), dtype=np.uint8)
    if seed:
        noise = cv2.GaussianBlur(noise, (0, 0), 4.0 * seed)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    try:
        assert drawn_map(load_drawing(tmp_path / "noise.png")).free.any()
    except MapError as error:
        assert "\n" not in str(error)
