"""A EuRoC sequence in ASL format: mav0 with cam0, cam1, imu0 and the ground truth.

https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets. The base frame is that of the left camera with x
along its view and z up in its picture, so that IMU and true poses are turned into it. The pictures are raw; the rectifying
rotations and projections are those of cv2.stereoRectify.
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

CAMERAS = ("cam0", "cam1")
BASE_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # a camera that faces forward
TRUTH_FOLDERS = ("state_groundtruth_estimate0", "mocap0", "vicon0")
MAX_SIDE_PX = 100_000  # of a picture
COEFFICIENTS = (4, 5, 8, 12, 14)  # of the distortion models of OpenCV
MAX_COEFFICIENT = 1e3  # of a distortion; real ones reach some tens
MAX_SKEW = 0.01  # of the product of a rotation with its transpose
MODELS = {"radial-tangential": "plumb_bob", "radtan": "plumb_bob", "equidistant": "equidistant"}


@dataclass(frozen=True, slots=True)
class EurocCamera:
    """One camera's sensor.yaml: size (px), K `(3, 3)`, D `(n,)`, ROS' name of the model, and T_body_camera `(4, 4)`."""

    size: tuple[int, int]
    K: Floats
    D: Floats
    model: str
    T_body_camera: Floats


def mav_folder(folder: Path) -> Path | None:
    """The folder with cam0 and cam1: the sequence's mav0, or the given one; None for another folder."""
    for candidate in (folder / "mav0", folder):
        if all((candidate / name / "sensor.yaml").is_file() for name in CAMERAS):
            return candidate
    return None


def open_euroc(folder: Path) -> DatasetSource:
    """The stereo pairs, their calibration, the yaw rate of the IMU, and the true poses."""
    mav = mav_folder(folder)
    assert mav is not None
    left, right = (_camera(mav / name / "sensor.yaml") for name in CAMERAS)
    infos, R_left = _rectified(left, right)
    streams: list[DatasetStream] = []
    files = [mav / name / "sensor.yaml" for name in CAMERAS]
    for name, (info, K_model) in zip(CAMERAS, zip(infos, (left, right), strict=True), strict=True):
        table = mav / name / "data.csv"
        rows = rows_of(table, ",")
        stamps = stamps_of(table, [row[0] for row in rows], "ns")
        if not stamps:
            raise LogError(f"{table}: no pictures")
        pictures = [row[1] if len(row) > 1 else f"{row[0]}.png" for row in rows]
        calibrated = _info(name, stamps[0], K_model, info)
        streams.append(single_event("camera_info", f"/{name}/camera_info", name, calibrated))
        streams.append(image_stream(mav / name / "data", name, f"/{name}/image_raw", stamps, pictures))
        files.append(table)
    R_base_body = BASE_OPTICAL @ left.T_body_camera[:3, :3].T
    if (table := mav / "imu0" / "data.csv").is_file():
        streams.append(_imu(table, R_base_body))
        files.append(table)
    for name in TRUTH_FOLDERS:
        if (table := mav / name / "data.csv").is_file():
            streams.append(_truth(table, left, R_base_body))
            files.append(table)
            break
    quat = quaternion_of_matrix(BASE_OPTICAL @ R_left.T)
    edges = [Transform(0, BASE_FRAME, name, (0.0, 0.0, 0.0), quat, is_static=True) for name in CAMERAS]
    return DatasetSource("EuRoC", streams, edges, files)


def _camera(path: Path) -> EurocCamera:
    document = read_yaml(path)
    try:
        fx, fy, cx, cy = (float(v) for v in document["intrinsics"])
        width, height = (int(v) for v in document["resolution"])
        D = np.array(document["distortion_coefficients"], np.float64)
        T = np.array(document["T_BS"]["data"], np.float64).reshape(4, 4)
        model = str(document.get("distortion_model", "radtan"))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise LogError(f"{path}: not the sensor.yaml of a camera ({short(error)})") from None
    if model not in MODELS:
        raise LogError(f"{path}: distortion model {model!r}; known are {', '.join(sorted(MODELS))}")
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    if wrong := _what_is_wrong(K, (width, height), D, T):
        raise LogError(f"{path}: {wrong}")
    return EurocCamera((width, height), K, D, MODELS[model], T)


def _what_is_wrong(K: Floats, size: tuple[int, int], D: Floats, T: Floats) -> str:
    """The value that no camera has, as a clause; "" if all are possible."""
    if not (0 < min(size) <= max(size) <= MAX_SIDE_PX):
        return f"a resolution of {size[0]} x {size[1]} pixels"
    if not (K[:2, :2].diagonal().min() > 0.0 and np.abs(K).max() <= MAX_SIDE_PX):
        return "intrinsics that are no focal lengths and centre in pixels"
    if D.ndim != 1 or len(D) not in COEFFICIENTS or not np.abs(D).max() <= MAX_COEFFICIENT:
        return "distortion_coefficients that no model has"
    turned = T[:3, :3]
    is_pose = (
        np.abs(T).max() <= MAX_COORDINATE_M
        and np.abs(T[3] - [0.0, 0.0, 0.0, 1.0]).max() < MAX_SKEW
        and np.abs(turned @ turned.T - np.eye(3)).max() < MAX_SKEW
        and np.linalg.det(turned) > 0.0
    )
    return "" if is_pose else "T_BS is no pose of a camera"


def _rectified(left: EurocCamera, right: EurocCamera) -> tuple[list[tuple[Floats, Floats]], Floats]:
    """(R, P) of both cameras, and the rectifying rotation of the left one."""
    import cv2

    T_right_left = np.linalg.inv(right.T_body_camera) @ left.T_body_camera
    R, t = T_right_left[:3, :3].copy(), T_right_left[:3, 3:].copy()
    no_pair = LogError(
        f"{CAMERAS[0]} and {CAMERAS[1]} are no pair: by their sensor.yaml they cannot be rectified"
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
    except cv2.error:  # both in one place
        raise no_pair from None
    found = [np.asarray(matrix, np.float64) for matrix in (R1, P1, R2, P2)]
    if not all(np.isfinite(matrix).all() for matrix in found):
        raise no_pair
    return [(found[0], found[1]), (found[2], found[3])], found[0]


def _info(name: str, stamp_ns: int, camera: EurocCamera, rectified: tuple[Floats, Floats]) -> CameraInfo:
    R, P = rectified
    return CameraInfo(
        stamp_ns,
        name,
        width_px=camera.size[0],
        height_px=camera.size[1],
        K=readonly(camera.K, np.float64),
        P=readonly(P, np.float64),
        D=readonly(camera.D, np.float64),
        camera=name,
        R=readonly(R, np.float64),
        distortion_model=camera.model,
    )


def _imu(table: Path, R_base_body: Floats) -> DatasetStream:
    """The yaw rate about the base frame's vertical."""
    rows = rows_of(table, ",")
    stamps = stamps_of(table, [row[0] for row in rows], "ns")
    rates = numbers_of(table, [row[1:] for row in rows], 3) @ R_base_body[2]

    def event(k: int) -> Event:
        return Imu(stamps[k], BASE_FRAME, float(rates[k]))

    return DatasetStream("imu", "/imu0", BASE_FRAME, stamps, event)


def _truth(table: Path, left: EurocCamera, R_base_body: Floats) -> DatasetStream:
    """The true poses of the base in the plane, from those of the body."""
    rows = rows_of(table, ",")
    stamps = stamps_of(table, [row[0] for row in rows], "ns")
    values = numbers_of(table, [row[1:] for row in rows], 7)  # position, and the quaternion w, x, y, z
    rotations = np.array([rotation_matrix(quat) for quat in values[:, 3:].tolist()]).reshape(-1, 3, 3)
    positions = values[:, :3] + rotations @ left.T_body_camera[:3, 3]
    return truth_stream(stamps, in_plane(positions, rotations @ R_base_body[0]))
