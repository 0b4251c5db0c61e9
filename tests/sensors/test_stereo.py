"""The geometry of the stereo head, its columns, and the likelihood of a disparity for every cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from gridslam.core.cameras import StereoHead
from gridslam.sensors.stereo_head import (
    MATCHED,
    NONE,
    UNKNOWN,
    ColumnSettings,
    StereoMatcher,
    measured_columns,
)
from gridslam.sensors.stereo_likelihood import StereoNoise, first_likelihoods

Floats = NDArray[np.float64]
OPTICAL = (0.5, -0.5, 0.5, -0.5)
HEAD = StereoHead.of_extrinsics(260.0, (159.5, 59.5), 0.12, OPTICAL, (0.1, 0.0, 0.6))
COLUMNS = ColumnSettings(
    bin_px=4,
    low_m=0.15,
    high_m=1.5,
    min_height_m=0.12,
    min_matched_ratio=0.25,
    take_nearest=True,
    max_disparity_px=64.0,
)


def view(depths: Floats) -> NDArray[np.float32]:
    """Disparities `(120, 320)` of walls `(320,)` from the floor up, and the floor before them."""
    rows = (np.arange(120) - 59.5) / 260.0
    floor = np.where(rows > 0.0, rows * 260.0 * 0.12 / 0.6, 0.0)
    return np.maximum(260.0 * 0.12 / depths[None], floor[:, None]).astype(np.float32)


def test_bearings_are_those_of_the_columns() -> None:
    columns = np.array([159.5, 159.5 + 260.0, 159.5 - 260.0])
    np.testing.assert_allclose(HEAD.bearings(columns), [0.0, -np.pi / 4, np.pi / 4], atol=1e-12)


def test_the_depth_of_a_range_is_its_component_along_the_axis() -> None:
    depths = HEAD.depths(np.array([0.0, np.pi / 3]), np.array([2.0, 4.0]), 0.6)
    np.testing.assert_allclose(depths, [[2.0, 4.0], [1.0, 2.0]], atol=1e-12)


def test_the_slope_of_a_pixel_gives_its_height() -> None:
    slope = HEAD.slope(120, 320)
    assert 0.6 + 2.0 * slope[0, 0] == pytest.approx(0.6 + 2.0 * 59.5 / 260.0)


def test_every_bin_measures_its_wall_and_not_the_floor() -> None:
    depths = np.full(320, 3.0)
    depths[100:140] = 1.5
    columns = measured_columns(view(depths), HEAD, COLUMNS)
    assert (columns.status == MATCHED).all()
    np.testing.assert_allclose(columns.disparities_px[2:20], 260.0 * 0.12 / 3.0, atol=0.3)
    np.testing.assert_allclose(columns.disparities_px[26:34], 260.0 * 0.12 / 1.5, atol=0.3)


def test_the_nearer_of_two_obstacles_counts_even_if_it_is_smaller() -> None:
    image = view(np.full(320, 4.0))
    image[62:82] = 260.0 * 0.12 / 2.0  # an obstacle of 15 cm before the wall
    nearest = measured_columns(image, HEAD, COLUMNS)
    np.testing.assert_allclose(nearest.disparities_px, 15.6, atol=0.3)
    dominant = measured_columns(image, HEAD, replace(COLUMNS, take_nearest=False))
    np.testing.assert_allclose(dominant.disparities_px, 7.8, atol=0.3)


def test_a_bin_of_floor_has_no_obstacle_and_one_without_matches_is_unknown() -> None:
    image = view(np.full(320, 3.0))
    image[:60] = np.nan  # no matches above the horizon
    image[60:, :] = view(np.full(320, 1e4))[60:, :]
    image[:, :40] = np.nan
    columns = measured_columns(image, HEAD, COLUMNS)
    assert (columns.status[:10] == UNKNOWN).all()
    assert (columns.status[10:] == NONE).all()


def test_the_likelihood_of_a_cell_is_the_mean_of_the_density_over_it() -> None:
    noise = StereoNoise(0.5, 0.1, 0.05, 64.0)
    edges = np.array([[1.0, 1.1, 1.2, 1.3]])
    first, none = first_likelihoods(np.array([27.0]), 31.2, edges, noise)
    for k in range(3):
        near, far = 31.2 / edges[0, k], 31.2 / edges[0, k + 1]

        def density(d: float) -> float:
            return float(np.exp(-0.5 * ((27.0 - d) / 0.5) ** 2) / (0.5 * np.sqrt(2.0 * np.pi)))

        mean = quad(density, far, near)[0] / (near - far)
        assert first[0, k] == pytest.approx(0.85 * mean + 0.05 / 64.0, rel=1e-6)
    assert none[0] == pytest.approx(0.05 / 64.0, rel=1e-2)


def test_no_match_is_unlikely_with_an_obstacle_and_likely_without() -> None:
    first, none = first_likelihoods(
        np.array([np.nan]), 31.2, np.array([[1.0, 2.0, 3.0]]), StereoNoise(0.5, 0.1, 0.05, 64.0)
    )
    np.testing.assert_allclose(first, 0.1)
    np.testing.assert_allclose(none, 0.95)


def test_a_match_beyond_the_last_cell_is_evidence_for_a_free_ray() -> None:
    first, none = first_likelihoods(
        np.array([2.0]), 31.2, np.array([[1.0, 2.0, 3.0]]), StereoNoise(0.5, 0.1, 0.05, 64.0)
    )
    assert none[0] > 20.0 * first.max()


@pytest.mark.parametrize("kind", ["sgbm", "bm"])
def test_the_matcher_finds_the_shift_of_a_textured_plane(kind: str) -> None:
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 255, (120, 400)).astype(np.uint8)
    left, right = texture[:, 20:340], texture[:, 30:350]  # the right camera sees it 10 px further left
    disparity = StereoMatcher(kind, 32).disparity(left, right)
    assert np.nanmedian(disparity[:, 60:300]) == pytest.approx(10.0, abs=0.3)
    assert np.isfinite(disparity[:, 60:300]).mean() > 0.8
