from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from gridslam.core.errors import ConfigError, LogError
from gridslam.core.messages import (
    DepthImage,
    Event,
    Image,
    LaserScan,
    Odometry,
    Range,
    TagInventory,
    Transform,
)
from gridslam.logs import LogConfig, open_log

SCAN = "stamp,angle_min,angle_increment,range_min,range_max,r0,r1,r2\n"
ODOM = "stamp,x,y,yaw\n"


def folder(path: Path, **files: str) -> Path:
    """A log of files; `log` is log.yaml, all others are CSV."""
    for name, text in files.items():
        (path / ("log.yaml" if name == "log" else f"{name}.csv")).write_text(text)
    return path


def events(path: Path, config: LogConfig | None = None) -> list[Event]:
    with open_log(path, config) as log:
        return [e for e in log.events() if not isinstance(e, Transform)]


def test_the_default_files_need_no_layout(tmp_path: Path) -> None:
    path = folder(
        tmp_path,
        scan=SCAN + "1.5,-0.5,0.5,0.1,30,1,2.25,inf\n1.6,-0.5,0.5,0.1,30,1\n",
        odom=ODOM + "1.5,1,2,0.5\n",
        imu="stamp,wz\n1.0,0.25\n",
        wheels="stamp,left,right\n1.0,0.5,-0.5\n",
        range="stamp,sensor,bearing,range,range_min,range_max\n2,ir_left,0.5,0.75,0.1,0.8\n",
        fix="stamp,x,y,yaw,var_x,var_y,var_yaw\n2,1,2,3,0.1,0.2,0.3\n",
        truth="stamp,x,y,yaw\n1,9,9,0\n",
    )
    with open_log(path) as log:
        names = [type(e).__name__ for e in log.events() if not isinstance(e, Transform)]
        assert names == ["Imu", "WheelTicks", "Odometry", "LaserScan", "LaserScan", "AbsolutePose", "Range"]
        truth = log.truth()
        assert truth is not None
        assert truth.poses.tolist() == [[9, 9, 0]]
        assert not log.is_lossy
    scans = [e for e in events(path) if isinstance(e, LaserScan)]
    assert [s.ranges_m.tolist() for s in scans] == [[1, 2.25, math.inf], [1]]
    assert scans[0].frame_id == "laser"


def test_a_row_may_be_longer_than_the_header_and_have_gaps(tmp_path: Path) -> None:
    path = folder(tmp_path, scan=SCAN + "1,0,0.1,0.1,30,1,2,3,4,5\n2,0,0.1,0.1,30,1,,3,,\n")
    first, second = events(path)
    assert first.ranges_m.tolist() == [1, 2, 3, 4, 5]
    assert np.array_equal(second.ranges_m, np.array([1, np.nan, 3], np.float32), equal_nan=True)


def test_velocities_may_be_there_or_not(tmp_path: Path) -> None:
    path = folder(tmp_path, odom="stamp,x,y,yaw,vx,wz\n1,0,0,0,0.5,0.25\n2,0,0,0,,\n")
    first, second = events(path)
    assert (first.vx_mps, first.wz_radps) == (0.5, 0.25)
    assert math.isnan(second.vx_mps)


def test_tag_reads_of_one_stamp_and_antenna_are_one_round_and_empty_rounds_count(tmp_path: Path) -> None:
    rows = "1,left,A,-40\n1,left,B,-50\n1,right,C,-60\n2,left,,\n3,left,,\n"
    path = folder(tmp_path, tags="stamp,antenna,tag_id,rssi\n" + rows)
    rounds = [(e.stamp_ns // 10**9, e.antenna, e.tag_ids, e.rssi_dbm) for e in events(path)]
    assert rounds == [
        (1, "left", ("A", "B"), (-40.0, -50.0)),
        (1, "right", ("C",), (-60.0,)),
        (2, "left", (), ()),
        (3, "left", (), ()),
    ]
    assert all(isinstance(e, TagInventory) for e in events(path))


def test_a_layout_renames_columns_converts_units_and_places_sensors(tmp_path: Path) -> None:
    layout = """
version: 1
base_frame: robot
streams:
  - kind: odom
    file: odom.csv
    topic: /wheels/odom
    columns: {stamp: t_ms, x: x_mm, y: y_mm, yaw: heading}
    units: {stamp: ms, x: mm, y: cm, yaw: deg_clockwise}
    frame: start
    child_frame: robot
  - kind: scan
    file: scan.csv
    columns: {r: d}
    units: {angle_min: deg, angle_increment: deg, r: mm, range_max: m}
    invalid: [0]
    invalid_from: 8000
    frame: lidar
extrinsics:
  lidar: {x: 0.5, yaw: 1.5707963267948966}
"""
    path = folder(
        tmp_path,
        log=layout,
        odom="heading,t_ms,x_mm,y_mm,extra\n90,1500.25,2500,50,7\n",
        scan="stamp,angle_min,angle_increment,range_min,range_max,d0,d1,d2,d3\n2,-90,90,0.1,7,1000,0,8000,65535\n",
    )
    with open_log(path, kinds=["scan", "odom"]) as log:
        extrinsics, odometry, scan = log.events()
        assert log.base_frame == "robot"
        assert {info.topic for info in log.streams} == {"/wheels/odom", "scan.csv"}
    assert isinstance(odometry, Odometry)
    assert odometry.stamp_ns == 1_500_250_000
    assert (odometry.x_m, odometry.y_m, odometry.frame_id, odometry.child_frame_id) == (
        2.5,
        0.5,
        "start",
        "robot",
    )
    assert odometry.yaw_rad == pytest.approx(-math.pi / 2)
    assert isinstance(scan, LaserScan)
    assert np.array_equal(scan.ranges_m, np.array([1, np.nan, np.nan, np.nan], np.float32), equal_nan=True)
    assert scan.angle_increment_rad == np.float32(math.pi / 2)
    assert (extrinsics.frame_id, extrinsics.child_frame_id, extrinsics.translation_m) == (
        "robot",
        "lidar",
        (0.5, 0, 0),
    )


INFRARED = """
csv:
  streams:
    - kind: range
      file: scans.csv
      columns: {bearing: bearing_deg, range: range_cm}
      units: {bearing: deg_clockwise, range: cm}
      constants: {sensor: tf_luna, range_min: 0.2, range_max: 8.0}
      invalid: [0]
      invalid_from: 22873
      row_stamps: {period_s: 0.01}
    - kind: odom
      file: scans.csv
      columns: {x: station_x_cm, y: station_y_cm}
      units: {x: cm, y: cm}
      constants: {yaw: 0.0}
      row_stamps: {period_s: 0.01}
extrinsics:
  tf_luna: {yaw: 1.5707963267948966}
"""


@pytest.mark.real_data
def test_the_infrared_log_is_read_with_a_layout_from_the_config(data_dir: Path) -> None:
    import yaml

    config = LogConfig.model_validate(yaml.safe_load(INFRARED))
    with open_log(data_dir / "infrared", config, ["range", "odom"]) as log:
        found = list(log.events())
        ranges = [e for e in found if isinstance(e, Range)]
        assert len(ranges) == 2400
        assert not log.is_lossy
        assert sum(math.isnan(r.range_m) for r in ranges) > 0
        (extrinsics,) = log.sensor_extrinsics
    # the log gives x = r sin b, y = r cos b of its first reading as (6.56, 208.90) cm
    r = ranges[0]
    direction = 2 * math.atan2(extrinsics.quat_wxyz[3], extrinsics.quat_wxyz[0]) + r.bearing_rad
    assert 100 * r.range_m * math.cos(direction) == pytest.approx(6.56, abs=0.01)
    assert 100 * r.range_m * math.sin(direction) == pytest.approx(208.90, abs=0.01)
    places = {(e.x_m, e.y_m) for e in found if isinstance(e, Odometry)}
    assert places == {(0, 0), (0, -3.58), (0, -6.71), (-3.33, -6.71), (-3.33, -3.58), (-3.33, 0)}


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("abc,0,0,0", "bad_stamp"),
        ("-5,0,0,0", "bad_stamp"),
        ("2,0,0", "wrong_number_of_fields"),
        ("2,0,0,0,0", "wrong_number_of_fields"),
        ("2,0,zero,0", "unreadable_row"),
        ("2,0,1_000,0", "unreadable_row"),
        ("2,0,\u0661,0", "unreadable_row"),
        ("2_0,0,0,0", "bad_stamp"),
        ("\u0662,0,0,0", "bad_stamp"),
        ("2,0,,0", "not_finite"),
        ("2,0,inf,0", "not_finite"),
        ('2,"0,0,0', "wrong_number_of_fields"),
    ],
)
def test_a_row_that_cannot_be_used_is_counted_with_its_line(tmp_path: Path, row: str, reason: str) -> None:
    path = folder(tmp_path, odom=f"{ODOM}1,0,0,0\n{row}\n3,0,0,0\n")
    with open_log(path) as log:
        assert [e.stamp_ns // 10**9 for e in log.events()] == [1, 3]
        assert log.counters[f"skipped.odom.{reason}"] == 1
        assert "odom.csv line 3" in log.problems[0] or reason == "not_finite"


def test_bytes_that_are_no_text_cost_their_row(tmp_path: Path) -> None:
    (tmp_path / "odom.csv").write_bytes(ODOM.encode() + b"1,0,0,0\n2,\xff\xfe,0,0\n3,0,0,0\n")
    with open_log(tmp_path) as log:
        assert len(list(log.events())) == 2
        assert log.counters["skipped.odom.undecodable"] == 1


def test_an_image_is_read_from_its_file_and_never_from_outside(tmp_path: Path) -> None:
    outside = tmp_path / "outside.png"
    Pillow.fromarray(np.full((2, 3), 7, np.uint8)).save(outside)
    log_folder = tmp_path / "log"
    log_folder.mkdir()
    Pillow.fromarray(np.full((2, 3), 5, np.uint8)).save(log_folder / "a.png")
    (log_folder / "link.png").symlink_to(outside)
    (log_folder / "damaged.png").write_bytes(b"\x89PNG\r\n\x1a\nbroken")
    names = ["a.png", "../outside.png", str(outside), "link.png", "absent.png", "damaged.png", "."]
    folder(
        log_folder, image="stamp,camera,file\n" + "".join(f"{i},left,{n}\n" for i, n in enumerate(names, 1))
    )
    with open_log(log_folder) as log:
        (image,) = [e for e in log.events() if isinstance(e, Image)]
        assert log.counters["skipped.image.file_outside_folder"] == 3
        assert log.counters["skipped.image.missing_file"] == 2
        assert log.counters["skipped.image.unreadable_image"] == 1
    assert image.pixels.tolist() == [[5, 5, 5]] * 2
    assert (image.camera, image.frame_id) == ("left", "left")


@pytest.mark.parametrize(
    "header", [b"{'descr': '<f4', ", b"(" * 200, b'{"descr": """', b"{'a': 1}", b"5", b""]
)
def test_a_depth_file_with_a_damaged_header_costs_its_row(tmp_path: Path, header: bytes) -> None:
    data = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    (tmp_path / "a.npy").write_bytes(data)
    with open_log(folder(tmp_path, depth="stamp,camera,file\n1,head,a.npy\n")) as log:
        assert not any(isinstance(e, DepthImage) for e in log.events())
        assert log.counters["skipped.depth.unreadable_image"] == 1


def test_depths_come_as_millimetres_in_png_or_metres_in_npy(tmp_path: Path) -> None:
    Pillow.fromarray(np.array([[0, 1500]], np.uint16)).save(tmp_path / "a.png")
    np.save(tmp_path / "b.npy", np.array([[np.nan, 1.5]], np.float32))
    np.save(tmp_path / "c.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    rows = "1,head,a.png\n2,head,b.npy\n3,head,c.npy\n"
    folder(tmp_path, depth="stamp,camera,file\n" + rows)
    with open_log(tmp_path) as log:
        depths = [e.depth_m for e in log.events() if isinstance(e, DepthImage)]
        assert log.counters["skipped.depth.unreadable_image"] == 1
    for depth in depths:
        np.testing.assert_array_equal(depth, np.array([[np.nan, 1.5]], np.float32))


@pytest.mark.parametrize(
    ("layout", "message"),
    [
        ("streams: [{kind: odom, file: ../odom.csv}]", "lies outside the log's folder"),
        ("streams: [{kind: odom, file: /etc/passwd}]", "lies outside the log's folder"),
        ("streams: [{kind: odom, file: absent.csv}]", "no such file"),
        (
            "streams: [{kind: odom, file: odom.csv, columns: {x: east}}]",
            r"no column 'east' for x; the header has: stamp, x",
        ),
    ],
)
def test_a_layout_that_does_not_fit_the_folder_is_refused(tmp_path: Path, layout: str, message: str) -> None:
    folder(tmp_path, log=layout, odom=ODOM)
    with pytest.raises(LogError, match=message):
        open_log(tmp_path)


@pytest.mark.parametrize(
    ("layout", "message"),
    [
        ("streams: [{kind: lidar, file: a.csv}]", "streams.0.kind: expected .*'scan'"),
        ("stream: []", r"stream: no such key \(did you mean 'streams'\?\)"),
        ("streams: [{kind: odom, file: a.csv, columns: {z: up_down, w: a}}]", "no column 'w'"),
        ("streams: [{kind: odom, file: a.csv, units: {x: inch}}]", "units"),
        ("streams: !!python/object/apply:os.getcwd []", "not valid YAML"),
        ("streams: [{kind: odom, file: a.csv, units: {stamp: mm}}]", "stamp in mm: expected ms, ns, s, us"),
        ("streams: [{kind: odom, file: a.csv, units: {yaw: mm}}]", "yaw in mm: expected deg"),
        ("streams: [{kind: fix, file: a.csv, units: {var_x: cm}}]", "var_x in cm: expected no unit"),
        ("streams: [{kind: odom, file: a.csv, row_stamps: {start_s: 3.0e+9, period_s: 1}}]", "start_s"),
        ("streams: [{kind: odom, file: a.csv, row_stamps: {period_s: 1.0e+300}}]", "period_s"),
        ("streams: [{kind: odom, file: a.csv, row_stamps: {period_s: 1.0e-300}}]", "period_s"),
    ],
)
def test_a_layout_that_is_wrong_is_refused_with_its_key(tmp_path: Path, layout: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        open_log(folder(tmp_path, log=layout, odom=ODOM))


def test_rows_beyond_the_last_stamp_that_a_log_can_hold_are_counted(tmp_path: Path) -> None:
    layout = "streams: [{kind: odom, file: odom.csv, row_stamps: {start_s: 2147483646, period_s: 1}}]"
    with open_log(folder(tmp_path, log=layout, odom="x,y,yaw\n" + "0,0,0\n" * 5)) as log:
        stamps = [e.stamp_ns for e in log.events()]
        assert stamps == [2147483646 * 10**9, 2147483647 * 10**9]
        assert log.counters["skipped.odom.bad_stamp"] == 3


def test_a_missing_column_is_named_with_the_line_to_write(tmp_path: Path) -> None:
    path = folder(tmp_path, odom="time,x,y,yaw\n1,0,0,0\n")
    with pytest.raises(LogError, match=r"no column 'stamp' for stamp.*columns: \{stamp: COLUMN\}"):
        open_log(path)


def test_a_folder_without_a_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"neither log.yaml nor one of .*scan.csv"):
        open_log(tmp_path)


def test_a_stream_without_rows_is_an_empty_stream(tmp_path: Path) -> None:
    with open_log(folder(tmp_path, scan=SCAN, odom=ODOM)) as log:
        assert [e for e in log.events() if not isinstance(e, Transform)] == []
        assert {info.kind: info.count for info in log.streams} == {"scan": 0, "odom": 0}


def test_a_table_of_its_own_is_read_by_the_layout_of_the_config(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t;x;y;th\n1;2;3;0.5\n2;3;3;0.5\n")
    columns = {"stamp": "t", "yaw": "th"}
    layout = {"streams": [{"kind": "odom", "file": "run.csv", "delimiter": ";", "columns": columns}]}
    with open_log(tmp_path / "run.csv", LogConfig.model_validate({"csv": layout}), ["odom"]) as log:
        assert [e.x_m for e in log.events() if isinstance(e, Odometry)] == [2.0, 3.0]
        assert list(log.input_hashes()) == ["run.csv"]
