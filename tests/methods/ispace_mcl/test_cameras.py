"""Messages of fixed cameras become observations for scans; messages that cannot be used are counted by reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gridslam.core.messages import CameraInfo, DepthImage, Image, Transform, readonly
from gridslam.methods.ispace_mcl.cameras.fixed_cameras import FixedCameras
from gridslam.sensors.fixed_camera import COLOUR_AND_DEPTH
from gridslam.sensors.floor_cells import FloorCells

ROWS, COLS, FOCAL = 48, 64, 50.0
FLOOR = FloorCells(np.argwhere(np.ones((60, 60))) - 30, 0.1)
S = 10**9
DOWN = (0.0, 1.0, 0.0, 0.0)  # the optical axis points to the floor


def cameras(**changes: Any) -> FixedCameras:
    """Fixed cameras with one calibrated camera `eye` three metres above the floor."""
    made = FixedCameras("map", FLOOR, replace(COLOUR_AND_DEPTH, stride_px=1, **changes))
    made.add_extrinsics(Transform(0, "map", "eye", (0.0, 0.0, 3.0), DOWN, True))
    made.add_info(info("eye"))
    return made


def info(frame: str, focal: float = FOCAL) -> CameraInfo:
    K = np.array([[focal, 0, 0.5 * (COLS - 1)], [0, focal, 0.5 * (ROWS - 1)], [0, 0, 1.0]])
    P = np.column_stack([K, np.zeros(3)])
    return CameraInfo(0, frame, COLS, ROWS, *(readonly(m, np.float64) for m in (K, P, np.zeros(5))))


def picture(stamp_ns: int, with_box: bool = False, frame: str = "eye") -> tuple[Image, DepthImage]:
    """The grey floor, with a red box of 1 m height in the middle or without."""
    noise = np.random.default_rng(stamp_ns % 2**32).normal(0.0, 1.5, (ROWS, COLS, 3))
    colour, depth = 120.0 + noise, np.full((ROWS, COLS), 3.0)
    if with_box:
        colour[20:28, 26:38] = (200.0, 30.0, 30.0)
        depth[20:28, 26:38] = 2.0
    return (
        Image(stamp_ns, frame, readonly(colour, np.uint8)),
        DepthImage(stamp_ns, frame, readonly(depth, np.float32)),
    )


def show(to: FixedCameras, stamp_ns: int, with_box: bool = False, frame: str = "eye") -> None:
    image, depth = picture(stamp_ns, with_box, frame)
    to.add_image(depth)
    to.add_image(image)


def warm(to: FixedCameras) -> None:
    """Show the five frames of the warm-up, one a second."""
    for k in range(1, 6):
        show(to, k * S)


def test_an_observation_has_the_moving_cells_and_the_odometry_since_the_frame() -> None:
    eye = cameras(min_area_m2=0.002)
    warm(eye)
    eye.add_pose(6 * S, np.array([1.0, 2.0, np.pi / 2]), False)
    eye.add_pose(7 * S, np.array([1.0, 3.0, np.pi / 2]), False)
    show(eye, 6 * S + S // 2, with_box=True)
    (frame,) = eye.observations_at(7 * S)
    assert frame.T_now_then == pytest.approx([-0.5, 0.0, 0.0])  # half a metre behind, by interpolation
    # The box of 12 x 8 pixels at 2 m: 0.48 m x 0.32 m about the axis.
    assert np.abs(frame.moving.centres).max(axis=0) == pytest.approx([0.22, 0.14], abs=0.07)
    assert 4.8 * 3.2 <= len(frame.moving) <= 5.8 * 4.2  # cells of 0.1 m, all cells that the box touches
    assert eye.observations_at(7 * S) == []
    assert eye.counters["used.image"] == eye.counters["used.depth"] == 1
    assert eye.counters["skipped.image.warm_up"] == eye.counters["skipped.depth.warm_up"] == 5


def test_all_observations_are_the_latest_frames_of_all_cameras_if_one_of_them_is_new() -> None:
    eye = cameras()
    eye.add_extrinsics(Transform(0, "map", "other", (5.0, 0.0, 3.0), DOWN, True))
    eye.add_info(info("other"))
    for k in range(1, 6):
        show(eye, k * S)
        show(eye, k * S, frame="other")
    for k in (60, 62, 64, 66):
        eye.add_pose(k * S // 10, np.array([k / 10.0, 0.0, 0.0]), False)
    show(eye, 60 * S // 10, with_box=True)
    show(eye, 60 * S // 10, frame="other")
    assert len(eye.all_observations_at(62 * S // 10)) == 2
    assert eye.all_observations_at(64 * S // 10) == []
    show(eye, 65 * S // 10, frame="other")
    first, second = eye.all_observations_at(66 * S // 10)
    assert (first.T_now_then[0], second.T_now_then[0]) == pytest.approx((-0.6, -0.1))


def test_frames_that_are_too_old_or_before_a_jump_are_counted_and_not_used() -> None:
    eye = cameras()
    warm(eye)
    eye.add_pose(6 * S, np.zeros(3), False)
    show(eye, 9 * S)
    assert eye.observations_at(8 * S) == []  # the frame is newer than the scan
    eye.add_pose(10 * S, np.zeros(3), False)
    assert eye.observations_at(10 * S) == []
    assert eye.counters["skipped.image.out_of_step"] == 1
    eye.add_pose(11 * S, np.zeros(3), True)  # odometry has jumped: the poses before are unknown
    show(eye, 11 * S - S // 10)
    assert eye.observations_at(11 * S) == []
    assert eye.counters["skipped.image.out_of_step"] == 2


def test_colour_and_depth_with_different_stamps_are_not_paired() -> None:
    eye = cameras()
    eye.add_image(picture(1 * S)[0])
    eye.add_image(picture(2 * S)[1])
    eye.add_image(picture(3 * S)[1])
    eye.add_image(picture(4 * S)[0])
    eye.finish()
    assert eye.counters["skipped.image.no_depth"] == 2
    assert eye.counters["skipped.depth.no_image"] == 2
    assert eye.counters["used.image"] == 0


@pytest.mark.parametrize(
    ("frame", "reason"), [("stranger", "no_calibration"), ("onboard", "not_fixed"), ("lost", "not_fixed")]
)
def test_cameras_without_calibration_or_map_transform_are_counted_by_reason(frame: str, reason: str) -> None:
    eye = cameras()
    eye.add_extrinsics(Transform(0, "base_link", "onboard", (0.0, 0.0, 1.0), DOWN, True))
    eye.add_info(info("onboard"))
    eye.add_info(info("lost"))
    show(eye, S, frame=frame)
    assert eye.counters[f"skipped.image.{reason}"] == eye.counters[f"skipped.depth.{reason}"] == 1
    assert eye.measures()[frame] == {
        "frames": {reason: 1},
        "moved": False,
        "coverage_m2": 0.0,
        "correction": None,
    }


def test_a_calibration_without_focal_length_is_refused_and_sizes_must_agree() -> None:
    eye = FixedCameras("map", FLOOR)
    eye.add_info(info("eye", focal=0.0))
    eye.add_info(info("eye", focal=float("nan")))
    assert eye.counters["skipped.camera_info.no_focal_length"] == 2
    eye = cameras()
    show(eye, S)
    image, depth = picture(2 * S)
    eye.add_image(DepthImage(2 * S, "eye", depth.depth_m[:20]))
    eye.add_image(image)
    eye.add_image(DepthImage(3 * S, "eye", depth.depth_m[:20]))
    eye.add_image(Image(3 * S, "eye", image.pixels[:20]))
    assert eye.counters["skipped.image.size_differs_from_depth"] == 1
    assert eye.counters["skipped.image.size_changed"] == 1


def test_a_camera_without_frames_for_five_seconds_is_reported_as_silent() -> None:
    eye = cameras()
    warm(eye)
    show(eye, 20 * S)  # after 15 s
    eye.add_pose(40 * S, np.zeros(3), False)
    eye.finish()
    frames = eye.measures()["eye"]["frames"]  # type: ignore[index]
    assert frames["silences"] == 2
    assert frames["after_last_scan"] == 1


def test_grey_images_are_accepted() -> None:
    eye = cameras()
    for k in range(1, 8):
        image, depth = picture(k * S, with_box=k == 7)
        eye.add_image(depth)
        eye.add_image(Image(k * S, "eye", readonly(image.pixels[..., 0], np.uint8)))
    eye.add_pose(7 * S, np.zeros(3), False)
    assert len(eye.observations_at(7 * S)[0].moving)
