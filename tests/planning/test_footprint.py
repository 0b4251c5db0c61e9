"""Discs that cover a robot's footprint."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.planning.footprint import cover_polygon, disc

FOOTPRINTS = {
    "rectangle": [(0.35, 0.2), (-0.15, 0.2), (-0.15, -0.2), (0.35, -0.2)],
    "clockwise": [(0.35, -0.2), (-0.15, -0.2), (-0.15, 0.2), (0.35, 0.2)],
    "triangle": [(0.5, 0.0), (-0.2, 0.25), (-0.2, -0.25)],
    "long": [(1.0, 0.1), (-1.0, 0.1), (-1.0, -0.1), (1.0, -0.1)],
}


def inside(corners: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    turned = np.array(
        [np.cross(b - a, points - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
    )
    return np.asarray((turned >= 0.0).all(axis=0) | (turned <= 0.0).all(axis=0))


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors")
@pytest.mark.parametrize("name", FOOTPRINTS)
def test_every_point_of_the_footprint_is_covered_and_little_beyond_it(name: str) -> None:
    corners = np.array(FOOTPRINTS[name])
    discs = cover_polygon(corners)
    points = np.random.default_rng(0).uniform(corners.min(0), corners.max(0), (20000, 2))
    points = np.vstack([points[inside(corners, points)], corners])
    distances = np.hypot(*np.moveaxis(points[:, None] - discs[None, :, :2], -1, 0))
    assert (distances <= discs[:, 2] + 1e-9).any(axis=1).all()
    assert len(discs) <= 80
    extent = corners.max(0) - corners.min(0)
    extent_of_discs = discs[:, :2].max(0) + discs[np.argmax(discs[:, 0]), 2]
    assert (extent_of_discs <= corners.max(0) + 0.3 * extent.max()).all()


@pytest.mark.parametrize(
    "corners",
    [
        [(0.0, 0.0), (1.0, 0.0)],
        [(0.3, 0.2), (-0.2, 0.2), (0.0, 0.0), (-0.2, -0.2)],
        [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)],
        [(float("nan"), 0.0), (1.0, 0.0), (0.0, 1.0)],
        [(1e300, 0.0), (0.0, 1e300), (-1e300, -1e300)],
    ],
)
def test_polygons_that_are_not_convex_around_the_origin_are_refused(
    corners: list[tuple[float, float]],
) -> None:
    with pytest.raises(ConfigError, match="footprint"):
        cover_polygon(np.array(corners))


def test_a_disc_has_a_positive_radius() -> None:
    np.testing.assert_array_equal(disc(0.2), [[0.0, 0.0, 0.2]])
    with pytest.raises(ConfigError):
        disc(0.0)
