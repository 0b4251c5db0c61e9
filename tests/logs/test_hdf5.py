"""HDF5 files of a lidar and of odometry: by default names, and by a layout."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.core.errors import LogError
from gridslam.core.messages import Event, LaserScan, Odometry, Range
from gridslam.logs import LogConfig, open_log

h5py = pytest.importorskip("h5py", reason="the extra hdf5 is not installed")
TIMES = 100.0 + 0.1 * np.arange(300)
RANGES = np.random.default_rng(0).uniform(1.0, 5.0, (300, 12)).astype(np.float32)
LIMITS = {"angle_min": -1.0, "angle_increment": 0.1, "range_min": 0.05, "range_max": 30.0}


def written(path: Path, **datasets: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in datasets.items():
            file[name.replace("__", "/")] = values
    return path


def events(path: Path, **config: Any) -> list[Event]:
    with open_log(path, LogConfig.model_validate(config), ["scan", "odom"]) as log:
        found = [e for e in log.events() if isinstance(e, LaserScan | Odometry | Range)]
        assert not log.is_lossy, log.problems
        assert log.format == "HDF5"
    return found


def check(found: list[Event]) -> None:
    scans = [e for e in found if isinstance(e, LaserScan)]
    odometry = [e for e in found if isinstance(e, Odometry)]
    assert (len(scans), len(odometry)) == (300, 300)
    assert scans[299].ranges_m.tobytes() == RANGES[299].tobytes()
    assert scans[1].stamp_ns == odometry[1].stamp_ns == 100_100_000_000
    assert (odometry[2].x_m, odometry[2].yaw_rad) == pytest.approx((2.0, 0.02))


def test_groups_named_like_kinds_are_read_with_attributes_as_constants(tmp_path: Path) -> None:
    number = np.arange(300.0)
    path = written(
        tmp_path / "a.h5", scan__stamp=TIMES, scan__ranges=RANGES, odom__stamp=TIMES, odom__x=number,
        odom__y=0.0 * number, odom__yaw=0.01 * number,
    )  # fmt: skip
    with h5py.File(path, "a") as file:
        file["scan"].attrs.update(LIMITS)
    check(events(path))


def test_loose_data_sets_are_read_by_a_layout(tmp_path: Path) -> None:
    number = np.arange(300.0)
    poses = np.column_stack([number, 0.0 * number, 0.01 * number])
    path = written(
        tmp_path / "a.h5", laser__t=1000.0 * TIMES, laser__data=1000.0 * RANGES, pose=poses, clock=TIMES
    )
    scan = {
        "kind": "scan", "file": "/laser", "columns": {"stamp": "t", "r": "data"}, "constants": LIMITS,
        "units": {"stamp": "ms"},
    }  # fmt: skip
    odom = {
        "kind": "odom",
        "file": "/",
        "columns": {"stamp": "clock", "x": "pose0", "y": "pose1", "yaw": "pose2"},
    }
    found = events(path, csv={"streams": [{**scan, "units": {"stamp": "ms", "r": "mm"}}, odom]})
    scans = [e for e in found if isinstance(e, LaserScan)]
    np.testing.assert_allclose(scans[5].ranges_m, RANGES[5], rtol=1e-6)
    assert [e.stamp_ns for e in found if isinstance(e, Odometry)][1] == 100_100_000_000


def test_a_table_of_named_fields_is_read(tmp_path: Path) -> None:
    table = np.zeros(300, [("stamp", "f8"), ("x", "f8"), ("y", "f8"), ("yaw", "f8")])
    table["stamp"], table["x"] = TIMES, np.arange(300)
    path = written(tmp_path / "a.h5", odom=table)
    found = events(path, csv={"streams": [{"kind": "odom", "file": "odom"}]})
    assert [e.x_m for e in found if isinstance(e, Odometry)] == list(range(300))


def test_a_file_without_names_that_are_known_lists_its_data_sets(tmp_path: Path) -> None:
    path = written(tmp_path / "a.h5", laser__t=TIMES, laser__data=RANGES)
    with pytest.raises(LogError, match=r"/laser/data \(300 x 12\), /laser/t \(300\).*log: \{csv: \{streams:"):
        open_log(path)
    with pytest.raises(LogError, match="no column 'stamp' for stamp; the header has: data0"):
        events(path, csv={"streams": [{"kind": "scan", "file": "laser", "constants": LIMITS}]})
    with pytest.raises(LogError, match="no group or data set 'lidar'"):
        events(path, csv={"streams": [{"kind": "scan", "file": "lidar"}]})


def test_a_damaged_file_and_data_outside_it_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.h5", laser__t=TIMES)
    path.write_bytes(path.read_bytes()[:600])
    with pytest.raises(LogError, match="cannot be read"):
        open_log(path)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["scan"] = h5py.ExternalLink("a.h5", "/laser")
    with pytest.raises(LogError, match="nothing"):
        open_log(tmp_path / "b.h5")


def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "a.h5", laser__t=TIMES)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(LogError, match=r"pip install 'gridslam\[hdf5\]'"):
        open_log(path)
