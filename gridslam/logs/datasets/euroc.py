"""A EuRoC sequence in ASL format: mav0 with cam0, cam1, imu0 and the ground truth.

https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets. The base frame lies in the left camera: x along
its optical axis, z to the top of its image. IMU readings and true poses, which the files give for the body frame, are converted
to it. The images are raw; cv2.stereoRectify computes the rectifying rotations R and projections P.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.config.errors import short
from gridslam.config.yaml_file import read_yaml
from gridslam.core.cameras import quaternion_of_matrix, rotation_matrix
from gridslam.core.errors import LogError
from gridslam.core.messages import CameraInfo, Event, Imu, Transform, readonly
from gridslam.core.poses import MAX_COORDINATE_M
from gridslam.logs.datasets.source import BASE_FRAME, DatasetSource, DatasetStream
from gridslam.logs.datasets.tables import (
    image_stream,
    in_plane,
    numbers_of,
    rows_of,
    single_event,
    stamps_of,
    truth_stream,
)

Floats = NDArray[np.float64]

CAMERAS = ("cam0", "cam1")  # left, right
# Rotation of the optical frame (x to the right, y down, z forward) in the base frame
R_BASE_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
TRUTH_FOLDERS = ("state_groundtruth_estimate0", "mocap0", "vicon0")
MAX_SIDE_PX = 100_000  # largest width or height of an image
COEFFICIENT_COUNTS = (4, 5, 8, 12, 14)  # the numbers of coefficients in OpenCV's distortion models
MAX_COEFFICIENT = 1e3  # largest distortion coefficient; those of real cameras are below 100
MAX_SKEW = 0.01  # largest difference of R R' from the identity, for a rotation R
ROS_MODELS = {"radial-tangential": "plumb_bob", "radtan": "plumb_bob", "equidistant": "equidistant"}


@dataclass(frozen=True, slots=True)
class EurocCamera:
    """One camera's sensor.yaml.

    `size` is (width, height) in px, `K` `(3, 3)` the camera matrix, `D` `(n,)` the distortion coefficients, `model` ROS's name of
    their model, and `T_body_camera` `(4, 4)` the pose of the optical frame in the body frame.
    """

    size: tuple[int, int]
    K: Floats
    D: Floats
    model: str
    T_body_camera: Floats


@dataclass(frozen=True, slots=True)
class Rectification:
    """Rectifying rotation `R` `(3, 3)` of a camera, and projection `P` `(3, 4)` (px) of its rectified image."""

    R: Floats
    P: Floats


def mav_folder(folder: Path) -> Path | None:
    """The folder that holds cam0 and cam1: `folder`/mav0 or `folder`; None if neither does."""
    for candidate in (folder / "mav0", folder):
        if all((candidate / name / "sensor.yaml").is_file() for name in CAMERAS):
            return candidate
    return None


def open_euroc(folder: Path) -> DatasetSource:
    """The stereo images with their calibration, the yaw rate of the IMU, and the true poses.

    `folder` must be one for which `mav_folder` finds a sequence. Raises LogError: a file of it cannot be read.
    """
    mav = mav_folder(folder)
    assert mav is not None
    left, right = (_camera(mav / name / "sensor.yaml") for name in CAMERAS)
    rectifications = _rectify(left, right)
    streams: list[DatasetStream] = []
    files = [mav / name / "sensor.yaml" for name in CAMERAS]
    for name, camera, rectification in zip(CAMERAS, (left, right), rectifications, strict=True):
        table = mav / name / "data.csv"
        rows = rows_of(table, ",")
        stamps = stamps_of(table, [row[0] for row in rows], "ns")
        if not stamps:
            raise LogError(f"{table}: no pictures")
        images = [row[1] if len(row) > 1 else f"{row[0]}.png" for row in rows]
        info = _camera_info(name, stamps[0], camera, rectification)
        streams.append(single_event("camera_info", f"/{name}/camera_info", name, info))
        streams.append(image_stream(mav / name / "data", name, f"/{name}/image_raw", stamps, images))
        files.append(table)
    R_base_body = R_BASE_CAMERA @ left.T_body_camera[:3, :3].T
    if (table := mav / "imu0" / "data.csv").is_file():
        streams.append(_imu(table, R_base_body))
        files.append(table)
    for name in TRUTH_FOLDERS:
        if (table := mav / name / "data.csv").is_file():
            streams.append(_truth(table, left, R_base_body))
            files.append(table)
            break
    quat = quaternion_of_matrix(R_BASE_CAMERA @ rectifications[0].R.T)
    edges = [Transform(0, BASE_FRAME, name, (0.0, 0.0, 0.0), quat, is_static=True) for name in CAMERAS]
    return DatasetSource("EuRoC", streams, edges, files)


def _camera(path: Path) -> EurocCamera:
    """The camera of a sensor.yaml. Raises LogError: a key is missing, or its value is impossible."""
    document = read_yaml(path)
    try:
        fx, fy, cx, cy = (float(v) for v in document["intrinsics"])
        width, height = (int(v) for v in document["resolution"])
        D = np.array(document["distortion_coefficients"], np.float64)
        T = np.array(document["T_BS"]["data"], np.float64).reshape(4, 4)
        model = str(document.get("distortion_model", "radtan"))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise LogError(f"{path}: not the sensor.yaml of a camera ({short(error)})") from None
    if model not in ROS_MODELS:
        raise LogError(f"{path}: distortion model {model!r}; known are {', '.join(sorted(ROS_MODELS))}")
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if wrong := _what_is_wrong(K, (width, height), D, T):
        raise LogError(f"{path}: {wrong}")
    return EurocCamera((width, height), K, D, ROS_MODELS[model], T)


def _what_is_wrong(K: Floats, size: tuple[int, int], D: Floats, T: Floats) -> str:
    """The value that no camera can have, as the end of an error message; "" if all values are possible."""
    if not (0 < min(size) <= max(size) <= MAX_SIDE_PX):
        return f"a resolution of {size[0]} x {size[1]} pixels"
    if not (K[:2, :2].diagonal().min() > 0.0 and np.abs(K).max() <= MAX_SIDE_PX):
        return "intrinsics are not focal lengths and a centre in pixels"
    if D.ndim != 1 or len(D) not in COEFFICIENT_COUNTS or not np.abs(D).max() <= MAX_COEFFICIENT:
        return "distortion_coefficients that no model has"
    rotation = T[:3, :3]
    is_pose = (
        np.abs(T).max() <= MAX_COORDINATE_M
        and np.abs(T[3] - [0.0, 0.0, 0.0, 1.0]).max() < MAX_SKEW
        and np.abs(rotation @ rotation.T - np.eye(3)).max() < MAX_SKEW
        and np.linalg.det(rotation) > 0.0
    )
    return "" if is_pose else "T_BS is not the pose of a camera"


def _rectify(left: EurocCamera, right: EurocCamera) -> tuple[Rectification, Rectification]:
    """The rectification of both cameras. Raises LogError: OpenCV finds none, as for two cameras in the same place."""
    import cv2

    T_right_left = np.linalg.inv(right.T_body_camera) @ left.T_body_camera
    R, t = T_right_left[:3, :3].copy(), T_right_left[:3, 3:].copy()
    not_a_pair = LogError(
        f"{CAMERAS[0]} and {CAMERAS[1]} are not a stereo pair: with the values in their sensor.yaml they cannot be rectified"
    )
    try:
        if left.model == "equidistant":
            R1, R2, P1, P2, _ = cv2.fisheye.stereoRectify(
                left.K, left.D[:4], right.K, right.D[:4], left.size, R, t, cv2.CALIB_ZERO_DISPARITY
            )
        else:
            R1, R2, P1, P2, *_ = cv2.stereoRectify(
                left.K, left.D, right.K, right.D, left.size, R, t, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0
            )
    except cv2.error:
        raise not_a_pair from None
    R1, P1, R2, P2 = (np.asarray(matrix, np.float64) for matrix in (R1, P1, R2, P2))
    if not all(np.isfinite(matrix).all() for matrix in (R1, P1, R2, P2)):
        raise not_a_pair
    return Rectification(R1, P1), Rectification(R2, P2)


def _camera_info(name: str, stamp_ns: int, camera: EurocCamera, rectification: Rectification) -> CameraInfo:
    return CameraInfo(
        stamp_ns,
        name,
        width_px=camera.size[0],
        height_px=camera.size[1],
        K=readonly(camera.K, np.float64),
        P=readonly(rectification.P, np.float64),
        D=readonly(camera.D, np.float64),
        camera=name,
        R=readonly(rectification.R, np.float64),
        distortion_model=camera.model,
    )


def _imu(table: Path, R_base_body: Floats) -> DatasetStream:
    """The turn rate (rad/s) about the z axis of the base frame."""
    rows = rows_of(table, ",")
    stamps = stamps_of(table, [row[0] for row in rows], "ns")
    rates = numbers_of(table, [row[1:] for row in rows], 3) @ R_base_body[2]

    def event(k: int) -> Event:
        return Imu(stamps[k], BASE_FRAME, float(rates[k]))

    return DatasetStream("imu", "/imu0", BASE_FRAME, stamps, event)


def _truth(table: Path, left: EurocCamera, R_base_body: Floats) -> DatasetStream:
    """The true poses of the base frame, projected to the ground plane, from those of the body frame."""
    rows = rows_of(table, ",")
    stamps = stamps_of(table, [row[0] for row in rows], "ns")
    values = numbers_of(table, [row[1:] for row in rows], 7)  # position, and the quaternion w, x, y, z
    rotations = np.array([rotation_matrix(quat) for quat in values[:, 3:].tolist()]).reshape(-1, 3, 3)
    positions = values[:, :3] + rotations @ left.T_body_camera[:3, 3]
    return truth_stream(stamps, in_plane(positions, rotations @ R_base_body[0]))
