"""A sequence of the KITTI odometry benchmark: image_0 and image_1 (or image_2 and image_3), calib.txt, times.txt, poses.

https://www.cvlibs.net/datasets/kitti/eval_odometry.php
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import OPTICAL_FORWARD
from gridslam.core.errors import LogError
from gridslam.core.messages import CameraInfo, Transform, readonly
from gridslam.logs.datasets.source import BASE_FRAME, DatasetSource, DatasetStream
from gridslam.logs.datasets.tables import (
    first_picture_size,
    image_stream,
    in_plane,
    numbers_of,
    rows_of,
    single_event,
    stamps_of,
    truth_stream,
)

Floats = NDArray[np.float64]

CAMERA_HEIGHT_M = 1.65  # height above the road, from the set-up of the car
PERIOD_NS = 100_000_000  # period of the pictures where times.txt is missing
PAIRS = ((("image_0", 0), ("image_1", 1)), (("image_2", 2), ("image_3", 3)), (("image_l", 0), ("image_r", 1)))
PICTURES = (".png", ".jpg", ".jpeg")


def is_kitti(folder: Path) -> bool:
    """Whether the folder is a sequence with a pair of cameras."""
    return (folder / "calib.txt").is_file() and _pair(folder) is not None


def open_kitti(folder: Path) -> DatasetSource:
    """The stereo pairs, their calibration, and the true poses if they are there."""
    pair = _pair(folder)
    assert pair is not None
    matrices = _projections(folder / "calib.txt")
    names = [
        sorted(p.name for p in (folder / name).iterdir() if p.suffix.lower() in PICTURES) for name, _ in pair
    ]
    if not names[0] or len(names[0]) != len(names[1]):
        raise LogError(
            f"{folder}: {len(names[0])} left and {len(names[1])} right pictures; expected the same number"
        )
    stamps, files = _stamps(folder, len(names[0]))
    rows, cols = first_picture_size(folder / pair[0][0], names[0][0])
    streams: list[DatasetStream] = []
    edges = []
    for side, (name, number), pictures in zip(("left", "right"), pair, names, strict=True):
        frame = f"camera_{side}"
        if number not in matrices:
            raise LogError(f"{folder / 'calib.txt'}: no projection matrix P{number} for {name}")
        P = matrices[number]
        # The frames of the rectified cameras are parallel; the left one is the origin of its pair.
        streams.append(
            single_event(
                "camera_info",
                f"/{side}/camera_info",
                frame,
                CameraInfo(
                    stamps[0],
                    frame,
                    width_px=cols,
                    height_px=rows,
                    K=readonly(P[:, :3], np.float64),
                    P=readonly(P, np.float64),
                    D=readonly(np.zeros(5), np.float64),
                    camera=side,
                ),
            )
        )
        streams.append(
            image_stream(folder / name, frame, f"/{side}/image_rect", stamps[: len(pictures)], pictures)
        )
        edges.append(
            Transform(0, BASE_FRAME, frame, (0.0, 0.0, CAMERA_HEIGHT_M), OPTICAL_FORWARD, is_static=True)
        )
    truth = next((p for p in _truth_files(folder) if p.is_file()), None)
    if truth is not None:
        poses = _poses(truth)
        streams.append(truth_stream(stamps[: len(poses)], poses[: len(stamps)]))
        files.append(truth)
    return DatasetSource("KITTI odometry", streams, edges, [folder / "calib.txt", *files])


def _pair(folder: Path) -> tuple[tuple[str, int], tuple[str, int]] | None:
    return next((pair for pair in PAIRS if all((folder / name).is_dir() for name, _ in pair)), None)


def _projections(path: Path) -> dict[int, Floats]:
    """P0 to P3 `(3, 4)` by number; lines without a name count from 0."""
    matrices = {}
    for place, row in enumerate(rows_of(path)):
        name = row[0].rstrip(":")
        if row[0].endswith(":"):
            if name not in ("P0", "P1", "P2", "P3"):
                continue  # Tr, of the velodyne
            number, values = int(name[1:]), row[1:]
        else:
            number, values = place, row
        matrices[number] = numbers_of(path, [values], 12).reshape(3, 4)
    return matrices


def _stamps(folder: Path, count: int) -> tuple[list[int], list[Path]]:
    """A stamp for each picture, and the file that they are from."""
    path = folder / "times.txt"
    if not path.is_file():
        return [PERIOD_NS * (k + 1) for k in range(count)], []
    stamps = stamps_of(path, [row[0] for row in rows_of(path)], "s")
    if len(stamps) < count:
        raise LogError(f"{path}: {len(stamps)} times for {count} pictures")
    return stamps[:count], [path]


def _truth_files(folder: Path) -> Sequence[Path]:
    """Possible files of the true poses: beside the pictures, and in the folder `poses` of the dataset."""
    return folder / "poses.txt", folder.parent.parent / "poses" / f"{folder.name}.txt"


def _poses(path: Path) -> Floats:
    """True poses `(n, 3)`: the first camera's forward axis is x, its left side y."""
    matrices = numbers_of(path, rows_of(path), 12).reshape(-1, 3, 4)
    to_base = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return in_plane(matrices[:, :, 3] @ to_base.T, matrices[:, :, 2] @ to_base.T)
