from __future__ import annotations

import bz2
import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import ConfigError, LogError
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.logs import LogConfig, open_log
from gridslam.logs.carmen.lines import beam_angles
from gridslam.logs.convert import convert_log
from tests.logs.mutations import sample_carmen
from tests.small_log import wall_ranges

FLASER = "FLASER 3 1.0 2.0 3.0 0.5 0.1 0.2 0.5 0.1 0.2 {time} host 0.5"
ODOM = "ODOM 9 9 0 0.25 0.5 0 {time} host 0.5"
ROBOTLASER = (
    "ROBOTLASER1 0 -1.5707963 3.1415927 1.0471976 81.83 0.01 0 4 1 2 3 4 2 7 8 "
    "1.5 0.0 0.0 1.0 0.0 0.0 0.3 0.1 0.5 0.5 1.0 {time} host 0.5"
)


def written(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "carmen.log"
    path.write_text("".join(line + "\n" for line in lines))
    return path


@pytest.mark.parametrize(
    ("beams", "last_deg", "step_deg"), [(180, 89, 1), (181, 90, 1), (360, 89.5, 0.5), (361, 90, 0.5)]
)
def test_the_field_of_view_follows_from_the_beam_count(beams: int, last_deg: float, step_deg: float) -> None:
    angle_min, increment = beam_angles(beams)
    assert math.degrees(angle_min) == pytest.approx(-90)
    assert math.degrees(increment) == pytest.approx(step_deg)
    assert math.degrees(angle_min + (beams - 1) * increment) == pytest.approx(last_deg)


def test_a_given_field_of_view_reaches_from_the_first_to_the_last_beam(tmp_path: Path) -> None:
    config = LogConfig.model_validate({"carmen": {"field_of_view_deg": 270}})
    with open_log(written(tmp_path, FLASER.format(time=1)), config) as log:
        scan = next(e for e in log.events() if isinstance(e, LaserScan))
    assert math.degrees(scan.angle_min_rad) == pytest.approx(-135, abs=1e-5)
    assert math.degrees(scan.angle_increment_rad) == pytest.approx(135, abs=1e-5)


def test_a_flaser_line_gives_its_odometry_and_then_its_scan(tmp_path: Path) -> None:
    with open_log(written(tmp_path, FLASER.format(time="1134864629.895182")), kinds=["scan", "odom"]) as log:
        _, odometry, scan = log.events()
    assert isinstance(odometry, Odometry)
    assert isinstance(scan, LaserScan)
    assert odometry.stamp_ns == scan.stamp_ns == 1_134_864_629_895_182_000
    assert (odometry.x_m, odometry.y_m) == (0.5, 0.1)
    assert odometry.yaw_rad == pytest.approx(0.2, abs=1e-12)
    assert scan.ranges_m.dtype == np.float32
    assert scan.ranges_m.tolist() == [1.0, 2.0, 3.0]


def test_robotlaser_says_its_own_geometry_and_speed(tmp_path: Path) -> None:
    with open_log(written(tmp_path, ROBOTLASER.format(time=3)), kinds=["scan", "odom"]) as log:
        extrinsics, odometry, scan = log.events()
    assert (scan.angle_min_rad, scan.angle_increment_rad) == pytest.approx((-1.5707963, 1.0471976))
    assert scan.range_max_m == np.float32(81.83)
    assert len(scan.ranges_m) == 4
    assert (odometry.x_m, odometry.vx_mps, odometry.wz_radps) == (1.0, 0.3, 0.1)
    assert extrinsics.translation_m == (0.5, 0.0, 0.0)  # laser at 1.5, robot at 1.0


def test_rawlaser_says_its_own_geometry_and_odom_lines_are_the_odometry(tmp_path: Path) -> None:
    raw = "RAWLASER1 4 -1.5707963 3.1415927 1.0471976 81.83 0.01 0 4 1 2 3 4 0 {time} host 0.1"
    lines = [
        line.format(time=time) for time in range(1, 5) for line in ("ODOM 5 6 0.5 0 0 0 {time} host 0", raw)
    ]
    with open_log(written(tmp_path, *lines), kinds=["scan", "odom"]) as log:
        events = [e for e in log.events() if not isinstance(e, Transform)]
    assert [type(e) for e in events] == [Odometry, LaserScan] * 4
    assert events[1].ranges_m.tolist() == [1, 2, 3, 4]
    assert events[1].angle_increment_rad == pytest.approx(1.0471976)
    assert (events[0].x_m, events[0].y_m) == (5.0, 6.0)


@pytest.mark.parametrize(("beams", "is_noted"), [(180, False), (361, False), (271, True), (541, True)])
def test_a_number_of_beams_that_no_laser_of_180_degrees_has_is_noted(
    tmp_path: Path, beams: int, is_noted: bool
) -> None:
    line = f"FLASER {beams} {'1.0 ' * beams}0 0 0 0 0 0 1 host 1"
    with open_log(written(tmp_path, line, line)) as log:
        assert any("field_of_view_deg" in problem for problem in log.problems) is is_noted


def test_odom_lines_are_replaced_by_the_odometry_of_the_scans(tmp_path: Path) -> None:
    path = written(tmp_path, ODOM.format(time=1), FLASER.format(time=2), ODOM.format(time=3))
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert [e.x_m for e in log.events() if isinstance(e, Odometry)] == [0.5]
        assert log.counters["unused.odom"] == 2
        assert not log.is_lossy
    chosen = LogConfig.model_validate({"topics": {"odom": "ODOM"}})
    with open_log(path, chosen, ["scan", "odom"]) as log:
        assert [e.x_m for e in log.events() if isinstance(e, Odometry)] == [9.0, 9.0]


def test_odom_lines_are_the_odometry_of_a_log_without_lasers(tmp_path: Path) -> None:
    with open_log(written(tmp_path, ODOM.format(time=1), ODOM.format(time=2))) as log:
        events = list(log.events())
    assert [(e.stamp_ns, e.vx_mps, e.wz_radps) for e in events] == [
        (10**9, 0.25, 0.5),
        (2 * 10**9, 0.25, 0.5),
    ]


def test_readings_that_pile_up_at_the_largest_value_are_no_return(tmp_path: Path) -> None:
    piled = " ".join(["4.5"] * 15 + ["50.0"] * 15)
    lines = [f"FLASER 30 {piled} 0 0 0 0 0 0 {i} host 0" for i in range(5)]
    with open_log(written(tmp_path, *lines)) as log:
        assert {e.range_max_m for e in log.events() if isinstance(e, LaserScan)} == {50.0}


def test_without_a_pile_the_largest_range_is_that_of_a_sick_laser(tmp_path: Path) -> None:
    with open_log(written(tmp_path, FLASER.format(time=1))) as log:
        assert [e.range_max_m for e in log.events() if isinstance(e, LaserScan)] == [np.float32(81.91)]


def test_an_out_of_order_stamp_keeps_its_place_and_is_counted(tmp_path: Path) -> None:
    times = [5, 7, 6, 8]
    path = written(tmp_path, *(FLASER.format(time=t) for t in times))
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert [e.stamp_ns // 10**9 for e in log.events() if isinstance(e, LaserScan)] == times
        assert log.counters["out_of_order.scan"] == 1
    with open_log(path, LogConfig(order="stamp"), ["scan", "odom"]) as log:
        assert [e.stamp_ns // 10**9 for e in log.events() if isinstance(e, LaserScan)] == sorted(times)


def test_the_beam_count_may_change_from_line_to_line(tmp_path: Path) -> None:
    two = "FLASER 2 1.0 2.0 0 0 0 0 0 0 2 host 0"
    with open_log(written(tmp_path, FLASER.format(time=1), two, FLASER.format(time=3))) as log:
        assert [len(e.ranges_m) for e in log.events() if isinstance(e, LaserScan)] == [3, 2, 3]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("FLASER 4 1.0 2.0 3.0 0 0 0 0 0 0 2 host 0", "wrong_number_of_fields"),
        ("FLASER 3 1.0 x 3.0 0 0 0 0 0 0 2 host 0", "unreadable_line"),
        ("FLASER 3 1.0 2.0 3.0 0 0 0 0 0 0 nan host 0", "bad_stamp"),
        ("FLASER 3 1.0 2.0 3.0 0 0 0 0 inf 0 2 host 0", "not_finite"),
        ("FLASER 0 0 0 0 0 0 0 2 host 0", "no_beams"),
        ("FLASER 3 1.0 2_0 3.0 0 0 0 0 0 0 2 host 0", "unreadable_line"),
        ("FLASER 0_3 1.0 2.0 3.0 0 0 0 0 0 0 2 host 0", "unreadable_line"),
        ("FLASER 3 1.0 2.0 3.0 0 0 0 0 0 0 2_0 host 0", "bad_stamp"),
        ("FLASER -3 1 2 3 0 0 0 0 0 0 2 host 0", "wrong_number_of_fields"),
    ],
)
def test_a_line_that_cannot_be_used_is_counted_with_its_number(
    tmp_path: Path, line: str, reason: str
) -> None:
    path = written(tmp_path, FLASER.format(time=1), line, FLASER.format(time=3))
    with open_log(path) as log:
        scans = [e for e in log.events() if isinstance(e, LaserScan)]
        assert len(scans) == 2
        assert log.counters[f"skipped.scan.{reason}"] == 1
        assert log.is_lossy
        assert "line 2" in log.problems[0]


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_packed_log_reads_like_a_plain_one_whatever_its_name(tmp_path: Path, pack: object) -> None:
    (tmp_path / "plain.txt").write_bytes(sample_carmen())
    (tmp_path / "packed.txt").write_bytes(pack(sample_carmen()))  # type: ignore[operator]
    config = LogConfig.model_validate({"topics": {"scan": "FLASER"}})
    with open_log(tmp_path / "plain.txt", config) as a, open_log(tmp_path / "packed.txt", config) as b:
        assert [repr(e) for e in a.events()] == [repr(e) for e in b.events()]
        assert b.compression in ("gzip", "bzip2")


def test_two_lasers_without_a_choice_are_an_error_that_lists_them(tmp_path: Path) -> None:
    path = written(tmp_path, FLASER.format(time=1), ROBOTLASER.format(time=2))
    with pytest.raises(ConfigError, match=r"FLASER .*ROBOTLASER1 .*log: \{topics: \{scan: FLASER\}\}"):
        open_log(path, kinds=["scan", "odom"])


def test_what_is_no_log_is_refused_with_what_would_be(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("Dear Sir,\n")
    (tmp_path / "empty").write_bytes(b"")
    with pytest.raises(LogError, match=r"letter\.txt: no log of a known format; readable are MCAP"):
        open_log(tmp_path / "letter.txt")
    with pytest.raises(LogError, match="empty"):
        open_log(tmp_path / "empty")
    with pytest.raises(LogError, match="no such file"):
        open_log(tmp_path / "absent")


def test_a_log_of_two_lasers_converts_to_two_topics(tmp_path: Path) -> None:
    path = written(tmp_path, FLASER.format(time=1), ROBOTLASER.format(time=2), FLASER.format(time=3))
    with open_log(path) as log:
        convert_log(log, tmp_path / "both.mcap")
    with open_log(tmp_path / "both.mcap") as log:
        topics = {info.topic: (info.kind, info.count) for info in log.streams}
    assert topics == {"/scan_flaser": ("scan", 2), "/scan_robotlaser1": ("scan", 1), "/odom": ("odom", 2)}


def test_an_empty_list_of_topics_leaves_the_odometry_out(tmp_path: Path) -> None:
    chosen = LogConfig.model_validate({"topics": {"odom": []}})
    with open_log(written(tmp_path, FLASER.format(time=1)), chosen, ["scan", "odom"]) as log:
        assert not any(isinstance(e, Odometry) for e in log.events())


def test_the_width_of_a_laser_that_says_none_follows_from_the_turns(tmp_path: Path) -> None:
    bearings = np.radians(np.linspace(-135.0, 135.0, 541))
    lines = []
    for k in range(40):
        yaw = 0.15 * k
        ranges = " ".join(f"{r:.2f}" for r in wall_ranges(1.0, 0.5, yaw + bearings))
        lines.append(f"FLASER 541 {ranges} 1.0 0.5 {yaw:.4f} 1.0 0.5 {yaw:.4f} {1000 + k} host 0")
    with open_log(written(tmp_path, *lines), kinds=["scan", "odom"]) as log:
        (first, *_) = (e for e in log.events() if isinstance(e, LaserScan))
        assert any("by the robot's turns they are 270 degrees wide" in line for line in log.problems)
        assert log.has_findings
    assert first.angle_min_rad == pytest.approx(math.radians(-135.0))
    assert first.angle_increment_rad == pytest.approx(math.radians(0.5))
