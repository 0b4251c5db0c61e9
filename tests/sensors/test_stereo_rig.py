"""Calibrations of stereo heads as drivers publish them: what is repaired, what is refused, what is noted."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.core.messages import CameraInfo, StereoPair
from gridslam.sensors.stereo_alignment import measured_alignment
from gridslam.sensors.stereo_rig import StereoRig, stereo_rig

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]

ROWS, COLS, FOCAL, BASELINE = 180, 240, 195.0, 0.12
DISPARITY = 9
K = np.array([[FOCAL, 0.0, 119.5], [0.0, FOCAL, 89.5], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.35, 0.12, 0.0, 0.0, 0.0])


def texture() -> Grey:
    """A picture with many corners."""
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 255, (ROWS // 4, COLS // 3)).astype(np.uint8)
    return np.asarray(cv2.resize(noise, (COLS + 40, ROWS), interpolation=cv2.INTER_CUBIC), np.uint8)


def pair(rows_lower: int = 0, is_raw: bool = False) -> StereoPair:
    """A plane with one disparity; points lie `rows_lower` rows lower in the right picture."""
    plane = texture()
    left, right = plane[:, 20 : 20 + COLS], plane[:, 20 + DISPARITY : 20 + DISPARITY + COLS]
    return StereoPair(0, "optical", left.copy(), np.roll(right, rows_lower, axis=0), is_raw)


def info(side: str, shift: float = 0.0) -> CameraInfo:
    """The calibration of one camera; `shift` is P[0, 3]."""
    P = np.column_stack([K, [shift, 0.0, 0.0]])
    return CameraInfo(0, "optical", COLS, ROWS, K, P, np.zeros(5), f"stereo/{side}")


LEFT, RIGHT = info("left"), info("right", -FOCAL * BASELINE)


def rig(left: CameraInfo = LEFT, right: CameraInfo = RIGHT, of: StereoPair | None = None) -> StereoRig:
    return stereo_rig(of or pair(), left, right)


def test_a_right_calibration_changes_no_picture_and_needs_no_note() -> None:
    found, given = rig(), pair()
    left, right = found.rectified(given)
    assert left is given.left
    assert right is given.right
    assert found.notes == []
    assert found.calibration.baseline_m == pytest.approx(BASELINE)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_a_calibration_of_scaled_pictures_is_scaled(scale: float) -> None:
    of = replace(LEFT, width_px=int(COLS / scale), height_px=int(ROWS / scale))
    found = rig(of, replace(RIGHT, width_px=of.width_px, height_px=of.height_px))
    assert found.calibration.focal_px == pytest.approx(scale * FOCAL)
    assert found.calibration.centre_px[0] == pytest.approx(scale * 120.0 - 0.5)  # the centre stays the centre
    assert found.calibration.baseline_m == pytest.approx(BASELINE)
    assert "scaled to 240 x 180" in found.notes[0]


def test_a_calibration_of_a_cropped_picture_is_refused() -> None:
    with pytest.raises(MethodError, match="240 x 180 px, but camera_info is for 240 x 160"):
        rig(replace(LEFT, height_px=160))


def test_a_baseline_in_millimetres_is_recognised() -> None:
    found = rig(right=info("right", -FOCAL * 1000.0 * BASELINE))
    assert found.calibration.baseline_m == pytest.approx(BASELINE)
    assert "taken as millimetres" in found.notes[0]


def test_a_baseline_of_any_other_unit_is_refused() -> None:
    with pytest.raises(MethodError, match="a baseline of 120000 m"):
        rig(right=info("right", -FOCAL * 1e6 * BASELINE))


def test_a_positive_sign_of_the_baseline_is_turned() -> None:
    found = rig(right=info("right", FOCAL * BASELINE))
    assert found.calibration.baseline_m == pytest.approx(BASELINE)
    assert "wrong sign" in found.notes[0]


def test_without_baseline_or_focal_length_there_is_an_error() -> None:
    with pytest.raises(MethodError, match=r"stereo/right: P\[3\] of the right camera_info gives no baseline"):
        rig(right=info("right"))
    with pytest.raises(MethodError, match="not calibrated"):
        rig(replace(LEFT, P=np.zeros((3, 4))), replace(RIGHT, P=np.zeros((3, 4))))


@pytest.mark.parametrize("offset", [-4, 3, 9])
def test_a_row_offset_is_measured_and_taken_back(offset: int) -> None:
    found = rig()
    left, right = found.rectified(pair(offset))
    assert found.row_offset_px == pytest.approx(offset, abs=0.3)
    assert "rows lower" in found.notes[0]
    inner = np.s_[15:-15]
    assert np.abs(right[inner].astype(float) - pair().right[inner]).mean() < 6.0
    assert left is not right


def test_exchanged_pictures_are_swapped_back() -> None:
    given, found = pair(), rig()
    left, right = found.rectified(replace(given, left=given.right, right=given.left))
    assert np.array_equal(left, given.left)
    assert np.array_equal(right, given.right)
    assert "exchanged" in found.notes[0]


def test_pictures_without_features_say_nothing() -> None:
    found = rig()
    flat = np.full((ROWS, COLS), 90, np.uint8)
    found.rectified(StereoPair(0, "optical", flat, flat))
    assert found.row_offset_px is None
    assert found.notes == []
    found.rectified(pair(3))
    assert found.row_offset_px == pytest.approx(3.0, abs=0.3)


@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_raw_pictures_are_undistorted_with_the_calibration(model: str) -> None:
    distortion = DISTORTION if model == "plumb_bob" else np.array([0.1, -0.02, 0.0, 0.0])
    given = pair()
    pixels = (
        np.stack(np.meshgrid(np.arange(COLS), np.arange(ROWS)), axis=-1).reshape(-1, 1, 2).astype(np.float64)
    )
    undo = cv2.undistortPoints if model == "plumb_bob" else cv2.fisheye.undistortPoints
    source = undo(pixels, K, distortion, P=K).reshape(ROWS, COLS, 2).astype(np.float32)
    raw = [cv2.remap(p, source, None, cv2.INTER_LINEAR) for p in (given.left, given.right)]
    left, right = (replace(i, D=distortion, distortion_model=model) for i in (LEFT, RIGHT))
    found = rig(left, right, replace(given, is_raw=True))
    rectified = found.rectified(StereoPair(0, "optical", *raw, is_raw=True))
    inner = np.s_[40:-40, 40:-40]
    for picture, expected in zip(rectified, (given.left, given.right), strict=True):
        assert np.abs(picture[inner].astype(float) - expected[inner]).mean() < 12.0
    assert np.abs(raw[0][inner].astype(float) - given.left[inner]).mean() > 20.0


def test_rectified_pictures_are_unchanged_though_the_camera_has_distortion() -> None:
    left, right = (replace(i, D=DISTORTION) for i in (LEFT, RIGHT))
    assert rig(left, right).maps is None
    assert rig(left, right, pair(is_raw=True)).maps is not None


def test_the_alignment_is_that_of_the_pictures() -> None:
    found = measured_alignment(pair(2).left, pair(2).right)
    assert found is not None
    assert found.row_offset_px == pytest.approx(2.0, abs=0.2)
    assert found.disparity_px == pytest.approx(DISPARITY, abs=0.2)
    assert found.inlier_ratio > 0.9
