"""Public datasets as they are downloaded, in miniature: KITTI odometry, EuRoC and TUM RGB-D folders."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Pillow

from gridslam.core.cameras import rotation_matrix
from gridslam.core.errors import LogError
from gridslam.core.messages import CameraInfo, DepthImage, Event, Image, Imu, StereoPair, Transform
from gridslam.logs import open_log, write_log

Floats = NDArray[np.float64]
E = TypeVar("E")

ROWS, COLS, FOCAL, BASELINE = 40, 60, 50.0, 0.1
K = np.array([[FOCAL, 0.0, 29.5], [0.0, FOCAL, 19.5], [0.0, 0.0, 1.0]])
SECOND = 10**9


def picture(value: int) -> NDArray[np.uint8]:
    return np.full((ROWS, COLS), value, np.uint8)


def save(path: Path, values: NDArray[np.generic]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Pillow.fromarray(values).save(path)


def events(folder: Path, *kinds: str) -> list[Event]:
    with open_log(folder, kinds=kinds) as log:
        found = list(log.events())
        assert log.problems == []
        return found


def of(found: list[Event], kind: type[E]) -> list[E]:
    return [event for event in found if isinstance(event, kind)]


def text(values: Floats) -> str:
    return " ".join(f"{v:.9g}" for v in np.ravel(values))


@pytest.fixture
def kitti(tmp_path: Path) -> Path:
    """Three pairs; the car drives 1 m a frame and turns left."""
    folder = tmp_path / "sequences" / "04"
    for k in range(3):
        save(folder / "image_0" / f"{k:06d}.png", picture(10 + k))
        save(folder / "image_1" / f"{k:06d}.png", picture(20 + k))
    P0, P1 = (np.column_stack([K, [shift, 0.0, 0.0]]) for shift in (0.0, -FOCAL * BASELINE))
    (folder / "calib.txt").write_text(f"P0: {text(P0)}\nP1: {text(P1)}\nTr: {text(P0)}\n")
    (folder / "times.txt").write_text("0.000000e+00\n1.036224e-01\n2.072438e-01\n")
    lines = []
    for k in range(3):
        yaw = 0.1 * k  # to the left: about minus y of the camera
        c, s = math.cos(yaw), math.sin(yaw)
        rotation = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        lines.append(text(np.column_stack([rotation, [-0.05 * k, 0.0, 1.0 * k]])))
    poses = tmp_path / "poses"
    poses.mkdir()
    (poses / "04.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_kitti_has_rectified_pairs_with_calibration_and_true_poses(kitti: Path) -> None:
    found = events(kitti, "stereo", "camera_info")
    pairs = of(found, StereoPair)
    assert [(p.stamp_ns, int(p.left[0, 0]), int(p.right[0, 0]), p.is_raw) for p in pairs] == [
        (0, 10, 20, False),
        (103_622_400, 11, 21, False),
        (207_243_800, 12, 22, False),
    ]
    infos = of(found, CameraInfo)
    assert [i.P[0, 3] for i in infos] == [0.0, -FOCAL * BASELINE]
    assert {t.translation_m[2] for t in of(found, Transform)} == {1.65}
    with open_log(kitti) as log:
        truth = log.truth()
    assert truth is not None
    np.testing.assert_allclose(truth.poses, [[k, 0.05 * k, 0.1 * k] for k in range(3)], atol=1e-9)


def test_kitti_without_times_is_ten_hertz_and_a_missing_picture_is_named(kitti: Path) -> None:
    (kitti / "times.txt").unlink()
    assert np.diff([p.stamp_ns for p in of(events(kitti, "stereo"), StereoPair)]).tolist() == [10**8] * 2
    (kitti / "image_1" / "000002.png").unlink()
    with pytest.raises(LogError, match="3 left and 2 right pictures"):
        open_log(kitti)


def test_a_wrong_line_of_a_calibration_is_named(kitti: Path) -> None:
    (kitti / "calib.txt").write_text("P0: 1 2 3\nP1: 4\n")
    with pytest.raises(LogError, match=r"calib.txt: entry 1: expected 12 numbers, found '1 2 3'"):
        open_log(kitti)


# The body's x is up, as in EuRoC
BODY_OPTICAL = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def euroc(tmp_path: Path) -> Path:
    """Two raw pairs; the vehicle yaws to the left at 0.5 rad/s and looks along the world's y at first."""
    mav = tmp_path / "V1_01_easy" / "mav0"
    for k, name in enumerate(("cam0", "cam1")):
        T = np.eye(4)
        T[:3, :3] = BODY_OPTICAL
        T[:3, 3] = BODY_OPTICAL @ [BASELINE * k, 0.0, 0.0]
        (mav / name).mkdir(parents=True)
        (mav / name / "sensor.yaml").write_text(
            f"sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: {np.ravel(T).tolist()}\n"
            f"resolution: [{COLS}, {ROWS}]\nintrinsics: [{FOCAL}, {FOCAL}, 29.5, 19.5]\n"
            "distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.02, 0.0, 0.0]\n"
        )
        lines = ["#timestamp [ns],filename"]
        for i in range(2):
            stamp = 1403715273262142976 + i * SECOND // 20
            lines.append(f"{stamp},{stamp}.png")
            save(mav / name / "data" / f"{stamp}.png", picture(10 * (k + 1) + i))
        (mav / name / "data.csv").write_text("\r\n".join(lines) + "\r\n")
    (mav / "imu0").mkdir()
    (mav / "imu0" / "data.csv").write_text(
        "#timestamp [ns],w_RS_S_x,...\n1403715273262142976,0.5,0.0,0.1,9.8,0,0\n"
    )
    # The base looks along the body's z; body in the world: x up, z along the world's y.
    quat = (0.5, -0.5, -0.5, -0.5)
    assert np.allclose(rotation_matrix(quat)[:, 0], [0.0, 0.0, 1.0])
    (mav / "state_groundtruth_estimate0").mkdir()
    (mav / "state_groundtruth_estimate0" / "data.csv").write_text(
        "#timestamp, p_RS_R_x [m], ...\n1403715273262142976,1.0,2.0,0.5,"
        + ",".join(map(str, quat))
        + ",0,0,0\n"
    )
    return mav.parent


def test_euroc_has_raw_pairs_with_rectification_yaw_rate_and_true_poses(euroc: Path) -> None:
    found = events(euroc, "stereo", "camera_info", "imu")
    pairs = of(found, StereoPair)
    assert [(int(p.left[0, 0]), int(p.right[0, 0]), p.is_raw) for p in pairs] == [
        (10, 20, True),
        (11, 21, True),
    ]
    left, right = of(found, CameraInfo)
    assert (left.P[0, 3] - right.P[0, 3]) / right.P[0, 0] == pytest.approx(BASELINE)
    assert np.allclose(left.R, np.eye(3), atol=1e-9)
    (imu,) = of(found, Imu)
    assert imu.wz_radps == pytest.approx(0.5)
    for edge in of(found, Transform):
        assert rotation_matrix(edge.quat_wxyz)[:, 2] == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    with open_log(euroc) as log:
        truth = log.truth()
    assert truth is not None
    forward = rotation_matrix((0.5, -0.5, -0.5, -0.5))[:, 2]
    np.testing.assert_allclose(truth.poses[0], [1.0, 2.0, math.atan2(forward[1], forward[0])], atol=1e-9)


def test_euroc_opens_by_the_sequence_or_by_its_mav0(euroc: Path) -> None:
    for folder in (euroc, euroc / "mav0"):
        with open_log(folder) as log:
            assert log.format == "EuRoC"


def test_a_distortion_model_that_is_not_known_is_named(euroc: Path) -> None:
    path = euroc / "mav0" / "cam1" / "sensor.yaml"
    path.write_text(path.read_text().replace("radial-tangential", "omni"))
    with pytest.raises(LogError, match="distortion model 'omni'"):
        open_log(euroc)


@pytest.fixture
def tum(tmp_path: Path) -> Path:
    """Two colour and depth pictures."""
    folder = tmp_path / "rgbd_dataset_freiburg3_office"
    stamps = ("1305031102.175304", "1305031102.211214")
    for k, stamp in enumerate(stamps):
        colours = np.zeros((ROWS, COLS, 3), np.uint8)
        colours[..., 0] = 100 + k
        save(folder / "rgb" / f"{stamp}.png", colours)
        depth = np.full((ROWS, COLS), 5000 * (k + 1), np.uint16)
        depth[0, 0] = 0
        save(folder / "depth" / f"{stamp}.png", depth)
    for kind in ("rgb", "depth"):
        lines = ["# timestamp filename", *(f"{stamp} {kind}/{stamp}.png" for stamp in stamps)]
        (folder / f"{kind}.txt").write_text("\n".join(lines) + "\n")
    # The optical axis along the world's x, its picture upright.
    (folder / "groundtruth.txt").write_text(
        "# timestamp tx ty tz qx qy qz qw\n1305031102.1758 1 2 1.4 -0.5 0.5 -0.5 0.5\n"
    )
    return folder


def test_tum_has_colours_depths_in_metres_calibration_and_true_poses(tum: Path) -> None:
    found = events(tum, "image", "depth", "camera_info")
    images, depths = of(found, Image), of(found, DepthImage)
    assert [int(i.pixels[0, 0, 0]) for i in images] == [100, 101]
    assert [float(d.depth_m[1, 1]) for d in depths] == [1.0, 2.0]
    assert all(np.isnan(d.depth_m[0, 0]) for d in depths)
    assert images[0].stamp_ns == 1305031102175304000
    (info,) = of(found, CameraInfo)
    assert info.K[0, 0] == 535.4
    with open_log(tum) as log:
        truth = log.truth()
    assert truth is not None
    np.testing.assert_allclose(truth.poses[0], [1.0, 2.0, 0.0], atol=1e-9)


def test_tum_of_another_camera_is_reported(tum: Path) -> None:
    other = tum.rename(tum.parent / "my_sequence")
    with open_log(other) as log:
        assert any("default calibration of 525 px" in line for line in log.problems)


def test_a_picture_that_a_list_names_and_the_folder_lacks_is_counted(tum: Path) -> None:
    (tum / "rgb" / "1305031102.211214.png").unlink()
    with open_log(tum, kinds=["image"]) as log:
        assert len(of(list(log.events()), Image)) == 1
        assert log.counters["skipped.image.missing_file"] == 1


def test_a_layout_of_ones_own_wins(tum: Path) -> None:
    (tum / "imu.csv").write_text("stamp,wz\n1.0,0.5\n")
    (tum / "log.yaml").write_text("version: 1\nstreams:\n  - {kind: imu, file: imu.csv}\n")
    with open_log(tum) as log:
        assert log.format == "CSV folder"


@pytest.mark.parametrize("name", ["log.mcap", "log"])
def test_raw_pictures_and_their_calibration_survive_a_conversion(
    euroc: Path, tmp_path: Path, name: str
) -> None:
    with open_log(euroc) as log:
        write_log(tmp_path / name, log.events())
    before, after = (events(path, "stereo", "camera_info") for path in (euroc, tmp_path / name))
    assert [p.is_raw for p in of(after, StereoPair)] == [True, True]
    for one, other in zip(of(before, CameraInfo), of(after, CameraInfo), strict=True):
        for matrices in ((one.K, other.K), (one.P, other.P), (one.R, other.R), (one.D, other.D)):
            np.testing.assert_array_equal(*matrices)
        assert one.distortion_model == other.distortion_model


@pytest.mark.parametrize(
    ("given", "other", "says"),
    [
        (f"[{COLS}, {ROWS}]", "[.inf, 40]", "not the sensor.yaml of a camera"),
        (f"[{COLS}, {ROWS}]", "[0, 40]", "0 x 40 pixels"),
        (f"[{FOCAL}, {FOCAL}, 29.5, 19.5]", "[.nan, 1, 2, 3]", "focal lengths"),
        ("[-0.1, 0.02, 0.0, 0.0]", "[-0.1, 0.02, 0.0]", "distortion_coefficients"),
        ("[-0.1, 0.02, 0.0, 0.0]", "[1.e+300, 0, 0, 0]", "distortion_coefficients"),
        ("data: [0.0, ", "data: [7.0, ", "T_BS is not the pose"),
        ("data: [0.0, ", "data: [.nan, ", "T_BS is not the pose"),
        ("0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 0.0, 0.0]", "T_BS is not the pose"),
    ],
)
def test_a_calibration_that_no_camera_has_is_named(euroc: Path, given: str, other: str, says: str) -> None:
    path = euroc / "mav0" / "cam1" / "sensor.yaml"
    text = path.read_text()
    assert given in text
    path.write_text(text.replace(given, other))
    with pytest.raises(LogError, match=says):
        open_log(euroc)


def test_two_cameras_in_one_place_are_no_pair(euroc: Path) -> None:
    shutil.copy(euroc / "mav0" / "cam0" / "sensor.yaml", euroc / "mav0" / "cam1" / "sensor.yaml")
    with pytest.raises(LogError, match="not a stereo pair"):
        open_log(euroc)


@pytest.mark.parametrize("content", [b"", b"no picture"])
def test_a_first_picture_that_cannot_be_read_is_named(kitti: Path, tum: Path, content: bytes) -> None:
    for folder, first in ((kitti, "image_0/000000.png"), (tum, "rgb/1305031102.175304.png")):
        (folder / first).write_bytes(content)
        with pytest.raises(LogError, match=r"\d.png: the first picture cannot be read"):
            open_log(folder)
        (folder / first).unlink()
    with pytest.raises(LogError, match="the first picture cannot be read"):
        open_log(tum)
