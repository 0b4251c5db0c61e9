"""The distortion of a fixed camera's lens is undone where its images are not rectified."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.messages import CameraInfo, Transform, readonly
from gridslam.sensors.lens import Lens
from gridslam.sensors.pinhole import Pinhole

DOWN = Transform(0, "map", "eye", (0.0, 0.0, 3.0), (0.0, 1.0, 0.0, 0.0), True)


def info(D: tuple[float, ...], model: str = "plumb_bob") -> CameraInfo:
    K = np.array([[240.0, 0.0, 159.5], [0.0, 240.0, 119.5], [0.0, 0.0, 1.0]])
    arrays = (readonly(m, np.float64) for m in (K, np.column_stack([K, np.zeros(3)]), np.array(D)))
    return CameraInfo(0, "eye", 320, 240, *arrays, distortion_model=model)


@pytest.mark.parametrize(
    ("D", "model"), [((-0.3, 0.1, 0.001, -0.001, 0.0), "plumb_bob"), ((0.05, -0.01, 0.0, 0.0), "equidistant")]
)
def test_pixels_and_points_of_a_raw_image_agree(D: tuple[float, ...], model: str) -> None:
    camera = Pinhole.of(info(D, model), DOWN, is_raw=True)
    rows, cols = np.mgrid[0:240:40, 0:320:40].reshape(2, -1)
    points = camera.to_map(rows, cols, np.full(len(rows), 3.0))
    pixels, depths = camera.to_pixels(points)
    np.testing.assert_allclose(pixels, np.column_stack([rows, cols]), atol=0.05)
    np.testing.assert_allclose(depths, 3.0)


def test_the_radial_formula_holds_and_without_it_a_corner_is_decimetres_off() -> None:
    """x (1 + k1 r^2) is where the lens shows a direction x: the plumb-bob model with one coefficient."""
    k1, direction = -0.2, np.array([0.55, 0.4])
    shown = direction * (1.0 + k1 * (direction @ direction))
    col, row = shown * 240.0 + (159.5, 119.5)
    raw, rectified = (Pinhole.of(info((k1, 0.0, 0.0, 0.0, 0.0)), DOWN, is_raw) for is_raw in (True, False))
    at = np.array([row]), np.array([col]), np.array([3.0])
    expected = 3.0 * np.hypot(*direction)
    assert np.hypot(*raw.to_map(*at)[0, :2]) == pytest.approx(expected, abs=0.01)
    assert np.hypot(*rectified.to_map(*at)[0, :2]) < expected - 0.15


def test_points_far_outside_of_the_image_are_shown_nowhere() -> None:
    camera = Pinhole.of(info((-0.3, 0.1, 0.0, 0.0, 0.0)), DOWN, is_raw=True)
    pixels, _ = camera.to_pixels(np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]]))
    assert np.isfinite(pixels[0]).all()
    assert np.isnan(pixels[1]).all()


def test_a_calibration_without_distortion_has_no_lens() -> None:
    assert Lens.of(info((0.0, 0.0, 0.0, 0.0, 0.0))) is None
    assert Lens.of(info((np.nan, 0.0, 0.0, 0.0, 0.0))) is None
