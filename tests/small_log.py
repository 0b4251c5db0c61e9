"""A log of a robot in a rectangular room, computed from the room's equation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

HALF_WIDTH_M, HALF_HEIGHT_M = 4.0, 3.0
START_NS = 1_700_000_000_123_456_789


def write_small_log(folder: Path, scans: int = 60, beams: int = 90) -> Path:
    """A CSV folder: the robot drives a circle of radius 1 m about the room's middle, a scan every 100 ms."""
    folder.mkdir(parents=True)
    odom, scan = ["stamp,x,y,yaw"], ["stamp,angle_min,angle_increment,range_min,range_max"]
    scan[0] += "".join(f",r{i}" for i in range(beams))
    angles = -np.pi + 2 * np.pi * np.arange(beams) / beams
    for k in range(scans):
        phase = 2 * np.pi * k / scans
        x, y, yaw = np.cos(phase), np.sin(phase), np.arctan2(np.cos(phase), -np.sin(phase))
        stamp = f"{(START_NS + k * 100_000_000) // 10**9}.{(START_NS + k * 100_000_000) % 10**9:09d}"
        odom.append(f"{stamp},{x!r},{y!r},{yaw!r}".replace("np.float64(", "").replace(")", ""))
        ranges = ",".join(f"{r:.6f}" for r in wall_ranges(x, y, yaw + angles))
        scan.append(f"{stamp},{-np.pi!r},{2 * np.pi / beams!r},0.05,20.0,{ranges}")
    (folder / "odom.csv").write_text("\n".join(odom) + "\n")
    (folder / "scan.csv").write_text("\n".join(scan) + "\n")
    (folder / "log.yaml").write_text("extrinsics: {laser: {x: 0.0, y: 0.0, yaw: 0.0}}\n")
    (folder / "truth.csv").write_text("\n".join(odom) + "\n")
    return folder


def wall_ranges(x: float, y: float, bearings: np.ndarray) -> np.ndarray:
    """Distance to the room's wall along each bearing from a point inside."""
    cos, sin = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide="ignore"):
        to_side = np.where(cos > 0, (HALF_WIDTH_M - x) / cos, (-HALF_WIDTH_M - x) / cos)
        to_end = np.where(sin > 0, (HALF_HEIGHT_M - y) / sin, (-HALF_HEIGHT_M - y) / sin)
    return np.minimum(to_side, to_end)
