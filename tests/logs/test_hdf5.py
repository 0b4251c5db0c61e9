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
from tests.fuzz.cases import limits

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


@pytest.mark.parametrize("value", ["abc", b"\xff", np.nan, np.inf, 1j, np.zeros(2), h5py.Empty("f8")])
def test_an_attribute_that_is_no_number_is_named(tmp_path: Path, value: Any) -> None:
    path = written(tmp_path / "a.h5", scan__stamp=TIMES, scan__ranges=RANGES)
    with h5py.File(path, "a") as file:
        file["scan"].attrs.update({**LIMITS, "angle_min": value})
    with pytest.raises(LogError, match="angle_min") as raised:
        open_log(path)
    assert "\n" not in str(raised.value)


def test_data_that_are_no_table_are_left_out(tmp_path: Path) -> None:
    path = written(tmp_path / "a.h5", odom__stamp=TIMES, odom__x=TIMES, odom__y=TIMES, odom__yaw=0.0 * TIMES)
    with h5py.File(path, "a") as file:
        odom = file["odom"]
        odom["nothing"], odom["scalar"], odom["cube"] = h5py.Empty("f8"), 3.0, np.zeros((300, 2, 2))
        odom["complex"], odom["own"] = np.zeros(300, complex), odom.ref
        odom.create_dataset("lists", (300,), h5py.vlen_dtype(np.int32))
        odom.create_dataset("frame", data=["odom"] * 300, dtype=h5py.string_dtype())
        odom[b"\xff\xfe"] = TIMES
        odom["nested"] = np.zeros(300, [("a", "f8"), ("b", [("c", "i4")])])
    found = events(path)
    assert len(found) == 300
    assert {event.frame_id for event in found if isinstance(event, Odometry)} == {"odom"}


@pytest.mark.parametrize(
    ("shape", "options", "says"),
    [
        ((300, 10**9), {"fillvalue": 0.0}, "at most 1048576"),
        ((10**9,), {"fillvalue": 0.0}, "far more than any file"),
        ((3,), {"maxshape": (None,), "chunks": (10**8,)}, "packed parts"),
    ],
)
def test_more_than_the_file_can_hold_is_refused_before_it_is_unpacked(
    tmp_path: Path, shape: tuple[int, ...], options: dict[str, Any], says: str
) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("scan/stamp", shape, "f8", **options)
        file["scan"].attrs.update(LIMITS)
    with limits(1.0, 100), pytest.raises(LogError, match=says):
        open_log(path)


def test_columns_that_pack_well_are_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name in ("stamp", "x", "y", "yaw"):
            file.create_dataset(f"odom/{name}", data=np.ones(30_000), compression="gzip")
    assert path.stat().st_size < 30_000
    with open_log(path) as log:
        assert log.streams[0].count == 30_000


def test_a_damaged_part_of_the_data_ends_in_a_line(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name in ("stamp", "x", "y", "yaw"):
            file.create_dataset(f"odom/{name}", data=TIMES, fletcher32=True)
        at = file["odom/x"].id.get_chunk_info(0).byte_offset
    data = bytearray(path.read_bytes())
    data[at] ^= 255
    path.write_bytes(data)
    with pytest.raises(LogError, match="cannot be read"):
        open_log(path)


def test_a_file_of_too_many_data_sets_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["many"] = np.zeros(1, [(f"f{i}", "i1") for i in range(1001)])
    with pytest.raises(LogError, match="more than 1000 data sets"):
        open_log(path)
