"""Every format of trajectory files gives the same poses; what is wrong in a file is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import InputError
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.stamps import format_stamp
from gridslam.evaluation.readers.trajectory_formats import read_poses

N = 40
STAMPS = 1_700_000_000_000_000_000 + np.arange(N) * 100_000_000
X, Y = np.linspace(0.0, 4.0, N), np.sin(np.linspace(0.0, 4.0, N))
YAW = np.arctan(np.cos(X))
QUATERNION = quaternion_of_yaw(YAW)


def rows(columns: np.ndarray, separator: str = " ", stamps: bool = True) -> str:
    return "".join(
        separator.join(([format_stamp(stamp)] if stamps else []) + [repr(float(v)) for v in row]) + "\n"
        for stamp, row in zip(STAMPS.tolist(), columns, strict=True)
    )


def kitti(rotations: np.ndarray, positions: np.ndarray) -> str:
    return rows(np.concatenate([rotations, positions[:, :, None]], axis=2).reshape(N, 12), stamps=False)


def rotation_about(axis: int, angles: np.ndarray) -> np.ndarray:
    """Rotation matrices `(n, 3, 3)` about a coordinate axis."""
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    found = np.tile(np.eye(3), (len(angles), 1, 1))
    found[:, i, i] = found[:, j, j] = np.cos(angles)
    found[:, i, j], found[:, j, i] = -np.sin(angles), np.sin(angles)
    return found


w, x, y, z = QUATERNION.T
ZERO = np.zeros(N)
TEXTS = {
    "tum": rows(np.column_stack([X, Y, ZERO, x, y, z, w])),
    "planar": rows(np.column_stack([X, Y, YAW])),
    "kitti": kitti(rotation_about(2, YAW), np.column_stack([X, Y, ZERO])),
    "kitti of a camera": kitti(rotation_about(1, -YAW), np.column_stack([-Y, ZERO, X])),
    "euroc": "#timestamp [ns], p_RS_R_x [m], ...\n"
    + "".join(
        ",".join([str(stamp), *(repr(float(v)) for v in row), "0", "0"]) + "\n"
        for stamp, row in zip(STAMPS.tolist(), np.column_stack([X, Y, ZERO, w, x, y, z]), strict=True)
    ),
    "csv": "stamp,x,y,yaw\n" + rows(np.column_stack([X, Y, YAW]), ","),
    "csv in degrees": "time,y,x,yaw_deg\n" + rows(np.column_stack([Y, X, np.degrees(YAW)]), ","),
    "csv of rostopic": "%time,field.pose.position.x,field.pose.position.y,field.pose.position.z,"
    "field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w\n"
    + "".join(
        ",".join([str(stamp), *(repr(float(v)) for v in row)]) + "\n"
        for stamp, row in zip(STAMPS.tolist(), np.column_stack([X, Y, ZERO, x, y, z, w]), strict=True)
    ),
    "csv of a message": "header.stamp.sec,header.stamp.nanosec,pose.position.x,pose.position.y,yaw\n"
    + "".join(
        f"{stamp // 10**9},{stamp % 10**9},{row[0]!r},{row[1]!r},{row[2]!r}\n"
        for stamp, row in zip(STAMPS.tolist(), np.column_stack([X, Y, YAW]).tolist(), strict=True)
    ),
    "tum in milliseconds": "".join(
        " ".join([str(stamp // 10**6), *(repr(float(v)) for v in row)]) + "\n"
        for stamp, row in zip(STAMPS.tolist(), np.column_stack([X, Y, ZERO, x, y, z, w]), strict=True)
    ),
}


@pytest.mark.parametrize("name", TEXTS)
def test_every_format_gives_the_same_poses(tmp_path: Path, name: str) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(TEXTS[name])
    series = read_poses(path)
    assert series.has_stamps == (not name.startswith("kitti"))
    if series.has_stamps:
        assert series.stamps_ns.tolist() == STAMPS.tolist()
    assert series.trajectory.poses == pytest.approx(np.column_stack([X, Y, YAW]), abs=1e-9)
    assert any("camera frame" in note for note in series.notes) == (name == "kitti of a camera")


@pytest.mark.parametrize(
    ("text", "place", "says"),
    [
        ("", "poses.txt", "no pose"),
        ("stamp,x,y\n1,2,3\n", "poses.txt:1", "yaw"),
        ("stamp,x,y,yaw\n", "poses.txt", "no pose below the header"),
        ("stamp,x,y,yaw\n1,2,3\n", "poses.txt:2", "3 numbers"),
        ("stamp,x,y,yaw\n-1,2,3,0\n", "poses.txt:2", "not a stamp"),
        ("1 2 3\n", "poses.txt:1", "3 numbers"),
        (" ".join(["1"] * 12) + "\n1 2 3\n", "poses.txt:2", "3 numbers"),
        ("1700000000000000000,0,0,0,0,0,0,0\n", "poses.txt:1", "quaternion"),
        ("sec,nanosec,x,y,yaw\n1,-5,0,0,0\n", "poses.txt:2", "not a stamp"),
        ("1700000000000 0 0 0\n1e3 0 0 0\n2e30 0 0 0\n", "poses.txt:3", "expected ms"),
        ("1700000000000000000,0,0,0,1,0,0,inf\n", "poses.txt:1", "'inf'"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, text: str, place: str, says: str) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_poses(path)
    assert place in str(error.value)
    assert says in str(error.value)


def test_semicolons_between_columns_are_named(tmp_path: Path) -> None:
    path = tmp_path / "est.csv"
    path.write_text("t;x;y;yaw\n1,5;0,0;1,0;0,1\n")
    with pytest.raises(InputError, match=r"est.csv:1: semicolons between the columns"):
        read_poses(path)
