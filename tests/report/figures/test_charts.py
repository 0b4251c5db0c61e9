"""Charts: what they show lies on the sheet, in both formats, whatever the values."""

from __future__ import annotations

import io
import time
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from gridslam.evaluation.association import Pairs
from gridslam.report.figures.chart_data import Chart, Curve
from gridslam.report.figures.charts import TEXT, draw_charts
from gridslam.report.figures.drawn_shapes import (
    PNG_SCALE,
    Disc,
    DrawnSheet,
    Stroke,
    TextLine,
    png_of,
    svg_of,
    text_width,
)
from gridslam.report.figures.evaluation_plots import (
    EvaluatedTrajectory,
    error_drawing,
    overlay_drawing,
    path_error_drawing,
    relative_drawing,
)

SVG = "{http://www.w3.org/2000/svg}"


def drawings(estimate: np.ndarray, truth: np.ndarray, name: str = "run") -> list[DrawnSheet]:
    stamps = np.arange(len(truth)) * 100_000_000
    result = EvaluatedTrajectory(name, Pairs(stamps, estimate, truth))
    found = [
        overlay_drawing([result, result], truth),
        error_drawing([result, result]),
        path_error_drawing(result),
    ]
    relative = relative_drawing([result, result])
    return found if relative is None else [*found, relative]


@pytest.mark.parametrize("scale", [0.0, 1e-9, 1e-3, 1.0, 1e5])
@pytest.mark.parametrize("origin", [0.0, -4e6])
def test_everything_lies_on_the_sheet(scale: float, origin: float) -> None:
    t = np.linspace(0.0, 6.0, 300)
    truth = np.column_stack([origin + 10 * np.cos(t), origin + 4 * np.sin(t), t])
    noise = np.random.default_rng(0).normal(0.0, scale, (300, 3)) * [1.0, 1.0, 0.0]
    for drawing in drawings(truth + noise, truth):
        for shape in drawing.shapes:
            if isinstance(shape, Stroke):
                assert (shape.points >= 0.0).all()
                assert (shape.points <= [drawing.width, drawing.height]).all()
            elif isinstance(shape, TextLine):
                width = text_width(shape.text, shape.size)
                left = shape.x - {"start": 0.0, "middle": 0.5, "end": 1.0}[shape.anchor] * width
                assert left >= 0.0
                assert left + width <= drawing.width
        assert ET.fromstring(svg_of(drawing)).tag == f"{SVG}svg"


def test_both_formats_show_the_same() -> None:
    curve = Curve(np.array([0.0, 4.0]), np.array([0.0, 2.0]), "#ff0000", "a < b", width=6.0, has_start=True)
    drawing = draw_charts([Chart([curve], "x", "y", "<title>", legend=[curve])], 400, 200)
    image = np.asarray(Image.open(io.BytesIO(png_of(drawing))))
    assert image.shape == (drawing.height * PNG_SCALE, drawing.width * PNG_SCALE, 3)
    line = next(s for s in drawing.shapes if isinstance(s, Stroke) and s.width == 6.0)
    col, row = np.rint(line.points.mean(axis=0) * PNG_SCALE).astype(int)
    assert image[row, col].tolist() == [255, 0, 0]
    assert sum(isinstance(shape, Disc) for shape in drawing.shapes) == 1
    texts = [element.text for element in ET.fromstring(svg_of(drawing)).iter(f"{SVG}text")]
    assert {"<title>", "a < b", "x", "y"} <= set(texts)


def test_charts_below_each_other_have_one_x_axis_and_long_names_keep_their_ends() -> None:
    t = np.arange(50.0)
    truth = np.column_stack([t, np.zeros(50), np.zeros(50)])
    drawing = drawings(truth + np.array([0.0, 0.1, 0.001]), truth, "very/long/" * 60 + "b.tum")[1]
    curves = [s.points for s in drawing.shapes if isinstance(s, Stroke) and len(s.points) == 50]
    assert {(points[0, 0], points[-1, 0]) for points in curves} == {(curves[0][0, 0], curves[0][-1, 0])}
    name = next(s for s in drawing.shapes if isinstance(s, TextLine) and "b.tum" in s.text)
    assert name.text.startswith("...")
    assert name.size == TEXT
    assert text_width(name.text, TEXT) < drawing.width / 2


def test_characters_that_hide_are_named_in_the_picture() -> None:
    chart = Chart([Curve(np.arange(2.0), np.arange(2.0), "#000000", "a\u202eb")], "x", "y", "a\x1bb")
    assert "\x1b" not in svg_of(draw_charts([chart], 300, 200))


def test_what_lies_behind_the_curves_of_a_plane_is_at_its_place_in_both_formats() -> None:
    def colours(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, :1] < 1.0, [200, 0, 0], [0, 0, 200]).astype(np.uint8)

    curve = Curve(np.array([0.0, 3.0]), np.array([0.0, 1.0]), "#00ff00")
    within = np.array([[0.0, -2.0], [0.0, 3.0]])
    drawing = draw_charts(
        [Chart([curve], "x (m)", "y (m)", is_plane=True, backdrop=colours, within=within)], 300, 200
    )
    line = next(s.points for s in drawing.shapes if isinstance(s, Stroke) and s.colour == "#00ff00")
    image = np.asarray(Image.open(io.BytesIO(png_of(drawing))))
    for x, colour in ((0.4, [200, 0, 0]), (1.4, [0, 0, 200])):
        col, row = np.rint(PNG_SCALE * (line[0] + [x / 3.0 * (line[1, 0] - line[0, 0]), 9.0])).astype(int)
        assert image[row, col].tolist() == colour
    assert len(list(ET.fromstring(svg_of(drawing)).iter(f"{SVG}image"))) == 1


def test_an_axis_of_logarithms_has_powers_of_ten() -> None:
    curve = Curve(np.arange(4.0), np.array([0.0, -1.0, -2.0, -2.9]), "#000000")
    drawing = draw_charts([Chart([curve], "x", "y", is_log=True)], 300, 200)
    assert {"1", "0.1", "0.01"} <= {shape.text for shape in drawing.shapes if isinstance(shape, TextLine)}


def test_a_dashed_line_that_covers_its_own_gaps_is_drawn_without_them() -> None:
    zigzag = np.stack([np.tile([0.0, 900.0], 5000), np.linspace(0.0, 90.0, 10_000)], axis=1)
    started = time.process_time()
    assert png_of(DrawnSheet(900, 100, [Stroke(zigzag, "#000000", 1.0, is_dashed=True)]))
    assert time.process_time() - started < 5.0
