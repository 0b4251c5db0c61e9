"""The street recorded by a car's stereo head (KITTI), as a CSV folder: pictures linked, calibration and poses rewritten."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory

CAMERA_HEIGHT_M = 1.65
FRAMES_HZ = 10
# A street is wider than a room: longer rays, coarser cells, fewer obstacles, and a road that is not quite flat.
STREET = (
    "method.max_range_m=30",
    "method.min_range_m=2",
    "method.resolution_m=0.1",
    "method.prior=0.1",
    "method.disparity.disparities=96",
    "method.observation.low_m=0.3",
    "method.observation.high_m=2",
    "method.advanced.observation.min_height_m=0.4",
    "method.advanced.map.surface_m=0.3",
    "method.correlation.r0=0.978",
    "method.advanced.correlation.behind_m=0.6",
)
QUAT = "[0.5, -0.5, 0.5, -0.5]"


def true_path(data: Path) -> Trajectory:
    """The car's poses in the plane: x along the view of the first frame, y to its left."""
    rows = np.loadtxt(data / "stereo" / "poses.txt").reshape(-1, 3, 4)
    forward = rows[:, :, 2]
    poses = np.column_stack([rows[:, 2, 3], -rows[:, 0, 3], np.arctan2(-forward[:, 0], forward[:, 2])])
    return Trajectory(stamps(len(rows)), poses)


def stamps(frames: int) -> NDArray[np.int64]:
    """Ten frames a second."""
    return np.asarray((np.arange(frames) + 1) * (10**9 // FRAMES_HZ), np.int64)


def write_street(data: Path, folder: Path) -> Path:
    """The log's folder, and what its files say."""
    source = data / "stereo"
    folder.mkdir(parents=True)
    calibration = np.loadtxt(source / "calib.txt").reshape(2, 3, 4)
    names = sorted(path.name for path in (source / "image_l").iterdir())
    for side in ("left", "right"):
        (folder / side).mkdir()
        lines = ["stamp,camera,file"]
        for name, stamp in zip(names, stamps(len(names)).tolist(), strict=True):
            linked_or_copied(source / f"image_{side[0]}" / name, folder / side / name)
            lines.append(f"{stamp / 1e9:.9f},{side},{side}/{name}")
        (folder / f"{side}.csv").write_text("\n".join(lines) + "\n")
    infos = [
        "stamp,camera,width,height," + ",".join([f"k{i}" for i in range(9)] + [f"p{i}" for i in range(12)])
    ]
    for side, P in zip(("left", "right"), calibration, strict=True):
        values = [*P[:, :3].ravel(), *P.ravel()]
        infos.append(f"0.1,{side},1226,370," + ",".join(f"{v:.9g}" for v in values))
    (folder / "camera_info.csv").write_text("\n".join(infos) + "\n")
    (folder / "log.yaml").write_text(
        "version: 1\nstreams:\n"
        "  - {kind: image, file: left.csv, frame: camera}\n"
        "  - {kind: image, file: right.csv, frame: camera}\n"
        "  - {kind: camera_info, file: camera_info.csv, frame: camera}\n"
        f"extrinsics:\n  camera: {{x: 0, z: {CAMERA_HEIGHT_M}, quat_wxyz: {QUAT}}}\n"
    )
    return folder


def linked_or_copied(source: Path, target: Path) -> None:
    """A hard link, or a copy across file systems: files of a log lie inside its folder."""
    try:
        os.link(source, target)
    except OSError:
        target.write_bytes(source.read_bytes())
