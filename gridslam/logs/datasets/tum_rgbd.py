"""A sequence of the TUM RGB-D benchmark: rgb.txt, depth.txt, groundtruth.txt.

https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats. The base frame is at the
camera, with x along its view and z up in its picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import OPTICAL_FORWARD, rotation_matrix
from gridslam.core.errors import LogError
from gridslam.core.files import real_path
from gridslam.core.messages import CameraInfo, DepthImage, Event, Transform, readonly
from gridslam.core.plain_files import read_plain_file
from gridslam.logs.datasets.source import BASE_FRAME, DatasetSource, DatasetStream
from gridslam.logs.datasets.tables import (
    MAX_BYTES,
    first_picture_size,
    image_stream,
    in_plane,
    inside,
    numbers_of,
    rows_of,
    single_event,
    stamps_of,
    truth_stream,
)
from gridslam.logs.encoding.cameras import opened_picture

Floats = NDArray[np.float64]

CAMERA = "camera"
DEPTH_UNITS_PER_M = 5000.0
# fx, fy, cx, cy and distortion of the cameras, by a part of the sequence's name; the depths are registered to the colours.
INTRINSICS = {
    "freiburg1": ((517.3, 516.5, 318.6, 255.3), (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)),
    "freiburg2": ((520.9, 521.0, 325.1, 249.7), (0.2312, -0.7849, -0.0033, -0.0001, 0.9172)),
    "freiburg3": ((535.4, 539.2, 320.1, 247.6), (0.0, 0.0, 0.0, 0.0, 0.0)),
}
ROS_DEFAULT = ((525.0, 525.0, 319.5, 239.5), (0.0, 0.0, 0.0, 0.0, 0.0))


def is_tum_rgbd(folder: Path) -> bool:
    """Whether the folder lists colour and depth pictures."""
    return (folder / "rgb.txt").is_file() and (folder / "depth.txt").is_file()


def open_tum_rgbd(folder: Path) -> DatasetSource:
    """Colours, depths, the calibration by the name of the sequence, and the true poses."""
    streams: list[DatasetStream] = []
    files = [folder / "rgb.txt", folder / "depth.txt"]
    (rgb_stamps, rgb_names), (depth_stamps, depth_names) = (_listed(path) for path in files)
    name = next((name for name in INTRINSICS if name in real_path(folder).name), "")
    notes = []
    if not name:
        notes.append(
            f"{folder.name}: the name of the sequence names no camera (freiburg1, 2 or 3): the default calibration of 525 px "
            "is used"
        )
    rows, cols = first_picture_size(folder, rgb_names[0])
    info = _info(min(rgb_stamps[0], depth_stamps[0]), rows, cols, *INTRINSICS.get(name, ROS_DEFAULT))
    streams.append(single_event("camera_info", "/camera/camera_info", CAMERA, info))
    streams.append(image_stream(folder, CAMERA, "/camera/rgb/image_color", rgb_stamps, rgb_names))
    streams.append(_depths(folder, depth_stamps, depth_names))
    if (truth := folder / "groundtruth.txt").is_file():
        listed = rows_of(truth)
        values = numbers_of(truth, [row[1:] for row in listed], 7)  # position, and the quaternion x, y, z, w
        rotations = [rotation_matrix((w, x, y, z)) for x, y, z, w in values[:, 3:].tolist()]
        forward = np.array(rotations).reshape(-1, 3, 3)[:, :, 2]
        stamps = stamps_of(truth, [row[0] for row in listed], "s")
        streams.append(truth_stream(stamps, in_plane(values[:, :3], forward)))
        files.append(truth)
    edges = [Transform(0, BASE_FRAME, CAMERA, (0.0, 0.0, 0.0), OPTICAL_FORWARD, is_static=True)]
    return DatasetSource("TUM RGB-D", streams, edges, files, notes)


def _listed(path: Path) -> tuple[list[int], list[str]]:
    """Stamps and names of pictures."""
    rows = [row for row in rows_of(path) if len(row) > 1]
    if not rows:
        raise LogError(f"{path}: no pictures")
    return stamps_of(path, [row[0] for row in rows], "s"), [row[1] for row in rows]


def _info(
    stamp_ns: int, rows: int, cols: int, intrinsics: tuple[float, ...], distortion: tuple[float, ...]
) -> CameraInfo:
    fx, fy, cx, cy = intrinsics
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraInfo(
        stamp_ns,
        CAMERA,
        width_px=cols,
        height_px=rows,
        K=readonly(K, np.float64),
        P=readonly(np.column_stack([K, np.zeros(3)]), np.float64),
        D=readonly(np.array(distortion), np.float64),
        camera=CAMERA,
    )


def _depths(folder: Path, stamps: list[int], names: list[str]) -> DatasetStream:
    """The depths in metres, NaN for none."""

    def event(k: int) -> Event:
        with opened_picture(read_plain_file(inside(folder, names[k]), MAX_BYTES), ("PNG",)) as picture:
            values = np.asarray(picture).astype(np.float32)
        if values.ndim != 2:
            raise ValueError("depths have one channel")
        depth = np.where(values == 0, np.float32(np.nan), values / np.float32(DEPTH_UNITS_PER_M))
        return DepthImage(stamps[k], CAMERA, readonly(depth, np.float32), CAMERA)

    return DatasetStream("depth", "/camera/depth/image", CAMERA, stamps, event)
