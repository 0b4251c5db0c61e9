"""The drawing laid over the finished map."""

from __future__ import annotations

import numpy as np

from tests.benchmarks.bench_drawn_buildings import trial
from tests.benchmarks.mapped_buildings import mapped_building
from tests.benchmarks.people_drawings import drawing_of


def test_a_person_s_drawing_is_laid_over_the_map_and_the_robot_is_within_a_metre() -> None:
    found = trial(3)
    assert found.fits
    assert found.within_1m > 0.95


def test_the_drawing_of_another_building_does_not_fit() -> None:
    assert not trial(2, is_wrong=True).fits


def test_the_true_correspondence_has_no_error() -> None:
    mapped = mapped_building(3)
    drawing = drawing_of(mapped.building, 3)
    points = mapped.poses[:, :2]
    np.testing.assert_allclose(drawing.errors_m(points, drawing.in_drawing(points)), 0.0, atol=1e-9)
