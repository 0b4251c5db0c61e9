"""gridslam info and gridslam convert."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from gridslam.cli.main import main
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.logs.mcap.writer import McapWriter
from tests.logs.mutations import SCANS, sample_csv, sample_mcap
from tests.logs.ros_samples import scan, tf, transform, write_mcap


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = main([str(a) for a in arguments])
    out, err = capsys.readouterr()
    return code, out, err


def test_info_shows_the_streams(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "info", sample_mcap(tmp_path / "a.mcap"))
    assert (code, err) == (0, "")
    assert "MCAP, compression zstd" in out
    assert any(
        line.split()[:4] == ["scan", "/scan", "sensor_msgs/msg/LaserScan", "100"] for line in out.splitlines()
    )


def test_info_with_a_config_says_what_a_run_would_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = sample_mcap(tmp_path / "a.mcap")
    code, out, _ = run(capsys, "info", log, "-c", "slam-sd")
    assert code == 0
    rows = {line.split()[0]: line.split()[-1] for line in out.splitlines() if len(line.split()) > 6}
    assert (rows["stream"], rows["scan"], rows["odom"]) == ("used", "yes", "yes")
    assert "the method does without: imu, tags" in out
    _, out, _ = run(capsys, "info", log, "-c", "slam-sd", "--json")
    assert json.loads(out)["missing"] == ["imu", "tags"]
    code, _, err = run(capsys, "info", log, "-c", "ir-scan")
    assert code != 0
    assert "no range stream, which the method needs" in err


def test_info_as_json_keeps_every_digit_of_a_stamp(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = run(capsys, "info", sample_mcap(tmp_path / "a.mcap"), "--json")
    document = json.loads(out)
    assert code == 0
    assert document["start"] == "1700000000.123456789"
    assert document["duration_s"] == pytest.approx(9.900000007)
    assert {s["topic"]: s["count"] for s in document["streams"]} == {"/odom": SCANS, "/scan": SCANS}
    assert document["extrinsics"][0]["translation_m"] == [0.2, 0.0, 0.1]
    assert document["is_lossy"] is False


@pytest.mark.parametrize("x_m", [math.nan, math.inf, 1e308])
def test_a_transform_to_nowhere_is_left_out_of_info_and_of_what_convert_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], x_m: float
) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        for parent, child in (("base_link", "mast"), ("mast", "laser")):
            writer.write(Transform(0, parent, child, (x_m, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True))
        writer.write(Odometry(10**9, "odom", 0.0, 0.0, 0.0))
        writer.write(LaserScan(10**9, "laser", np.ones(9, np.float32), -1.0, 0.1, 0.05, 30.0))
    code, out, _ = run(capsys, "info", path, "--json")
    document = json.loads(out, parse_constant=str)
    assert code == 0
    assert sum(n for key, n in document["counters"].items() if key.startswith("skipped.tf.")) == 2
    assert [m["translation_m"] for m in document["extrinsics"]] == [[0.0, 0.0, 0.0]]
    assert run(capsys, "convert", path, tmp_path / "csv")[0] == 0
    assert run(capsys, "info", tmp_path / "csv")[0] == 0


def test_the_rate_of_messages_a_nanosecond_apart_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "odom.csv").write_text(
        "stamp,x,y,yaw\n1700000000.000000001,0,0,0\n1700000000.000000002,0,0,0\n"
    )
    code, out, _ = run(capsys, "info", tmp_path)
    assert code == 0
    assert "1000000000.0" in out


def test_strict_ends_with_3_on_a_cut_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = sample_mcap(tmp_path / "a.mcap")
    path.write_bytes(path.read_bytes()[:100_000])
    code, _, err = run(capsys, "info", path)
    assert code == 0
    assert "note: lost 1 x" in err
    assert run(capsys, "info", path, "--strict")[0] == 3
    assert run(capsys, "convert", path, tmp_path / "out.mcap", "--strict")[0] == 3
    assert (tmp_path / "out.mcap").is_file()


def test_what_is_no_log_ends_with_3_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "info", tmp_path / "absent.mcap")
    assert (code, out) == (3, "")
    assert err.count("\n") == 1
    assert "no such file" in err


def test_convert_takes_topics_and_a_span_of_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = sample_mcap(tmp_path / "a.mcap")
    code, out, _ = run(
        capsys, "convert", path, tmp_path / "b", "--topics", "/scan", "--start", 1, "--end", 2, "--json"
    )
    assert code == 0
    # scans come 7 ns after each tenth of a second: 1.0 to 1.9 s lie inside, 2.000000007 s outside
    assert json.loads(out)["written"] == {"/scan": 10}
    _, out, _ = run(capsys, "info", tmp_path / "b", "--json")
    assert [s["topic"] for s in json.loads(out)["streams"]] == ["/scan"]


def test_convert_refuses_an_unknown_topic_and_an_existing_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = sample_csv(tmp_path / "a")
    code, _, err = run(capsys, "convert", path, tmp_path / "b.mcap", "--topics", "/lidar")
    assert code == 2
    assert "no topic '/lidar'; it has: odom.csv, scan.csv" in err
    assert not (tmp_path / "b.mcap").exists()
    (tmp_path / "b.mcap").write_bytes(b"mine")
    code, _, err = run(capsys, "convert", path, tmp_path / "b.mcap")
    assert code == 2
    assert "--force" in err
    assert (tmp_path / "b.mcap").read_bytes() == b"mine"
    assert run(capsys, "convert", path, tmp_path / "b.mcap", "--force")[0] == 0
    assert (tmp_path / "b.mcap").read_bytes()[1:5] == b"MCAP"


@pytest.mark.parametrize(
    ("output", "span", "says"),
    [
        ("b.bag", (), ".bag is not written"),
        ("b.mcap", ("--start", 2, "--end", 1), "the end lies before the start"),
        ("b.mcap", ("--start", 1000), "no message to write between --start and --end"),
    ],
)
def test_convert_refuses_what_would_give_no_log_and_leaves_nothing_behind(
    output: str, span: tuple[object, ...], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = sample_csv(tmp_path / "a")
    code, _, err = run(capsys, "convert", path, tmp_path / output, *span)
    assert code == 2
    assert says in err
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_folder_that_holds_logs_is_refused_with_advice_to_name_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sample_mcap(tmp_path / "monday.mcap")
    sample_mcap(tmp_path / "tuesday.mcap")
    code, _, err = run(capsys, "info", tmp_path)
    assert code == 3
    assert "a folder with 2 logs: monday.mcap, tuesday.mcap; name one of them" in err


def test_a_pipe_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe")
    code, _, err = run(capsys, "info", tmp_path / "pipe")
    assert code == 3
    assert "save it to a file first" in err


def test_info_looks_into_the_messages_when_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = sample_csv(tmp_path / "a")
    lines = (path / "odom.csv").read_text().splitlines()
    lines[3] = lines[3].rsplit(",", 5)[0] + ",inf,0,0,0,0"
    (path / "odom.csv").write_text("\n".join(lines) + "\n")
    assert run(capsys, "info", path, "--strict")[0] == 0
    code, out, err = run(capsys, "info", path, "--strict", "--check", "--json")
    assert code == 3
    assert json.loads(out)["counters"]["skipped.odom.not_finite"] == 1
    assert "odom.csv message 3" in json.loads(out)["problems"][0]
    assert "--strict" in err


def test_a_layout_may_be_given_for_a_folder_without_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "poses.txt").write_text("t;east;north;heading\n1;250;50;0\n")
    layout = tmp_path / "layout.yaml"
    layout.write_text(
        "streams:\n  - kind: odom\n    file: poses.txt\n    delimiter: ';'\n"
        "    columns: {stamp: t, x: east, y: north, yaw: heading}\n    units: {x: cm, y: cm}\n"
    )
    assert run(capsys, "info", tmp_path / "a")[0] == 3
    assert run(capsys, "convert", tmp_path / "a", tmp_path / "b", "--layout", layout)[0] == 0
    assert (tmp_path / "b" / "odom.csv").read_text().splitlines()[1] == "1.000000000,2.5,0.5,0.0,,"


def test_convert_writes_a_rosbag2_folder_read_by_a_config(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = sample_mcap(tmp_path / "a.mcap")
    config = tmp_path / "c.yaml"
    config.write_text("method: {name: slam-sd}\nlog: {base_frame: chassis}\n")
    code, _, err = run(capsys, "convert", log, "-o", tmp_path / "bag", "-c", config)
    assert code == 0, err
    assert (tmp_path / "bag" / "metadata.yaml").is_file()
    code, _, err = run(capsys, "convert", log, tmp_path / "b", "-o", tmp_path / "c")
    assert code == 2
    assert "either OUT or -o DIR" in err


def test_info_of_a_part_counts_only_its_messages(small_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(small_log), "--json"]) == 0
    whole = json.loads(capsys.readouterr().out)
    assert main(["info", str(small_log), "--start", "1", "--end", "2.5", "--json"]) == 0
    part = json.loads(capsys.readouterr().out)
    assert 1.2 < part["duration_s"] <= 1.5 < whole["duration_s"]
    counts = {stream["kind"]: stream["count"] for stream in whole["streams"]}
    for stream in part["streams"]:
        if stream["kind"] in ("scan", "odom"):
            assert 0 < stream["count"] < 0.5 * counts[stream["kind"]]
    assert main(["info", str(small_log), "--start", "2", "--end", "1"]) == 2
    assert "the end lies before the start" in capsys.readouterr().err
    assert main(["info", str(small_log), "--start", "1000"]) == 2
    assert "the log has only" in capsys.readouterr().err


@pytest.mark.parametrize("seconds", ["inf", "1e300", "nan", "-1"])
def test_seconds_that_no_log_has_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, seconds: str
) -> None:
    log = sample_mcap(tmp_path / "a.mcap")
    for option in ("--start", "--end"):
        code, _, err = run(capsys, "convert", log, tmp_path / "out.mcap", f"{option}={seconds}")
        assert (code, err.count("\n")) == (2, 1), err
        assert list(tmp_path.glob("out*")) == []


def test_info_says_what_contradicts_itself_and_strict_forbids_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    messages = [("/scan", scan(k * 10**9, np.ones(21), angle_increment=0.2)) for k in range(1, 9)]
    path = write_mcap(tmp_path / "a.mcap", messages)
    code, _, err = run(capsys, "info", path)
    assert code == 0
    assert "contradicts angle_min, angle_max" in err
    assert run(capsys, "info", path, "--strict")[0] == 3
    good = write_mcap(
        tmp_path / "b.mcap", [("/tf_static", tf(transform(0, "base_link", "laser", (0.1, 0, 0))))]
    )
    assert run(capsys, "info", good, "--strict")[0] == 0


def test_info_says_what_a_run_would_ask_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = [(topic, scan(k * 10**9)) for k in range(1, 5) for topic in ("/a", "/b")]
    code, _, err = run(capsys, "info", write_mcap(tmp_path / "a.mcap", messages))
    assert code == 0
    assert "a run would end with this: log.topics.scan" in err
