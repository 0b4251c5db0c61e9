"""MRPT rawlogs: scans, odometry and actions in any arrangement, plain or packed, whole or damaged."""

from __future__ import annotations

import gzip
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import LogError
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.logs import open_log
from gridslam.logs.rotations import yaw_of
from tests.rawlog_objects import (
    action_of,
    frame_of,
    object_of,
    odometry_of,
    pose_3d,
    scan_of,
)

S = 10**9
START_NS = 1_600_000_000 * S


def events_of(path: Path) -> tuple[list[LaserScan], list[Odometry], list[Transform], list[str]]:
    with open_log(path, kinds=("scan", "odom")) as log:
        events = list(log.events())
        return (
            [e for e in events if isinstance(e, LaserScan)],
            [e for e in events if isinstance(e, Odometry)],
            [e for e in events if isinstance(e, Transform)],
            log.problems,
        )


@pytest.mark.parametrize("version", [4, 5, 6, 7, 8])
@pytest.mark.parametrize("is_packed", [False, True])
@pytest.mark.parametrize("space", ["", "mrpt::obs::"])
def test_scans_and_odometry_one_after_the_other(
    tmp_path: Path, version: int, is_packed: bool, space: str
) -> None:
    data = b"".join(
        odometry_of(START_NS + k * S, 0.1 * k, 0.2, space) + scan_of(START_NS + k * S, version, space=space)
        for k in range(5)
    )
    path = tmp_path / "a.rawlog"
    path.write_bytes(gzip.compress(data, mtime=0) if is_packed else data)
    scans, odometry, (extrinsics,), _ = events_of(path)
    assert [s.stamp_ns for s in scans] == [START_NS + k * S for k in range(5)]
    np.testing.assert_array_equal(scans[0].ranges_m, np.float32([1.0, 2.0, np.nan, np.inf, 3.0]))
    assert scans[0].angle_min_rad == pytest.approx(-math.pi / 2)
    assert scans[0].angle_increment_rad == pytest.approx(math.pi / 4)
    assert scans[0].time_increment_s == pytest.approx(0.01 if version == 8 else 0.0)
    assert [o.x_m for o in odometry] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert extrinsics.child_frame_id == ("laser" if version == 4 else "HOKUYO")
    assert extrinsics.translation_m == (0.2, 0.0, 0.3) and yaw_of(extrinsics.quat_wxyz) == pytest.approx(0.5)


@pytest.mark.parametrize("version", [4, 5, 6, 7])
def test_increments_of_actions_are_added_up_to_the_scans_after_them(tmp_path: Path, version: int) -> None:
    data = b"".join(
        action_of(0.5, math.pi / 2, version) + frame_of(scan_of(START_NS + k * S, to_left=False))
        for k in range(4)
    )
    (tmp_path / "a.rawlog").write_bytes(data)
    scans, odometry, _, _ = events_of(tmp_path / "a.rawlog")
    assert [o.stamp_ns for o in odometry] == [s.stamp_ns for s in scans]
    np.testing.assert_allclose(
        [(o.x_m, o.y_m) for o in odometry], [(0.5, 0), (0.5, 0.5), (0, 0.5), (0, 0)], atol=1e-9
    )
    assert scans[0].angle_increment_rad == pytest.approx(-math.pi / 4)
    assert scans[0].angle_min_rad == pytest.approx(math.pi / 2)


def test_what_is_not_read_and_what_is_damaged_is_named(tmp_path: Path) -> None:
    whole = scan_of(START_NS)
    picture = object_of("CObservationImage", 3, bytes(1000))
    data = (
        picture + whole + scan_of(START_NS + S)[:-1] + b"\x00" + frame_of(scan_of(START_NS + 2 * S), picture)
    )
    (tmp_path / "a.rawlog").write_bytes(data)
    scans, _, _, problems = events_of(tmp_path / "a.rawlog")
    assert [s.stamp_ns for s in scans] == [START_NS, START_NS + 2 * S]
    assert any("not read: 2 CObservationImage" in line for line in problems)
    with open_log(tmp_path / "a.rawlog") as log:
        assert log.is_lossy


@pytest.mark.parametrize("side", [1, 3, 4])
def test_a_place_as_a_matrix_is_read_if_it_is_a_homogeneous_one(tmp_path: Path, side: int) -> None:
    matrix = object_of("CMatrixD", 0, struct.pack("<2I", side, side) + np.eye(side).tobytes())
    odd = scan_of(START_NS + S).replace(pose_3d(0.2, 0.5), object_of("CPose3D", 1, matrix))
    (tmp_path / "a.rawlog").write_bytes(scan_of(START_NS) + odd)
    scans, _, _, _ = events_of(tmp_path / "a.rawlog")
    assert len(scans) == (2 if side == 4 else 1)


@pytest.mark.parametrize("cut", [30, 120, 180])
def test_a_rawlog_without_a_whole_scan_is_refused(tmp_path: Path, cut: int) -> None:
    (tmp_path / "a.rawlog").write_bytes(scan_of(START_NS)[:cut])
    with pytest.raises(LogError, match="without scans"):
        open_log(tmp_path / "a.rawlog")


def test_a_damaged_packed_rawlog_and_a_bomb_are_refused(tmp_path: Path) -> None:
    packed = gzip.compress(scan_of(START_NS) + np.random.default_rng(0).bytes(200_000), mtime=0)
    (tmp_path / "a.rawlog").write_bytes(packed[:-30_000])
    with pytest.raises(LogError, match="damaged"):
        open_log(tmp_path / "a.rawlog")
    (tmp_path / "b.rawlog").write_bytes(gzip.compress(scan_of(START_NS) + bytes(8 << 20), mtime=0))
    with pytest.raises(LogError, match="more than 4 MiB"):
        open_log(tmp_path / "b.rawlog")
