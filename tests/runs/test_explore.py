"""`gridslam explore`: the closed loop as a command, and its log mapped again."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from cli.main import main
from gridslam.core.messages import Odometry
from gridslam.runs.closed_loop import InStampOrder
from tests.conftest import REPOSITORY

DRAWING = REPOSITORY / "configs" / "worlds" / "drawings" / "corridor.png"
START = "2.7,3.2,0"


@pytest.fixture(scope="module")
def explored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run directory of the shortest corridor."""
    output = tmp_path_factory.mktemp("explored") / "run"
    arguments = [
        "explore",
        "hand-corridor-20",
        "--drawing",
        str(DRAWING),
        "-c",
        "handmap-slam",
        "-o",
        str(output),
    ]
    assert main([*arguments, "--start-in-drawing", START, "--quiet"]) == 0
    return output


def test_the_run_directory_holds_map_log_truth_tour_and_picture(explored: Path) -> None:
    names = {path.name for path in explored.iterdir()}
    expected = {"map.pgm", "map.yaml", "map.png", "trajectory.tum", "report.json", "run.yaml", "tour.csv"}
    assert names >= expected | {"log.mcap", "truth", "exploration.png", "drawing.png"}
    assert {p.name for p in (explored / "truth").iterdir()} >= {
        "trajectory.tum",
        "map.pgm",
        "map.yaml",
        "world.yaml",
    }
    report = json.loads((explored / "report.json").read_text())
    facts = report["measures"]["exploration"]
    assert report["command"] == "explore"
    assert facts["ended"] == "finished"
    assert facts["unreachable"] == []
    assert facts["min_clearance_m"] > 0.0
    assert report["errors"]["ape"]["trans"]["rmse"] < 0.1
    with (explored / "tour.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == facts["points"]
    assert {row["status"] for row in rows} <= {"reached", "seen"}


def test_the_robot_does_not_wait_before_it_drives(explored: Path) -> None:
    path = np.loadtxt(explored / "truth" / "trajectory.tum")
    early = path[path[:, 0] < path[0, 0] + 10.0]
    assert np.hypot(*(early[-1, 1:3] - early[0, 1:3])) > 0.5


def test_it_can_be_evaluated_like_any_run(explored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gates = ["--require", "map.accuracy.mean<=0.05", "--require", "ape.trans.rmse<=0.1"]
    assert main(["evaluate", str(explored), *gates, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["map"]["completeness"]["mean"] < 0.1


def test_mapping_its_log_again_gives_the_same_bytes(explored: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    arguments = [
        "map",
        str(explored / "log.mcap"),
        "-c",
        str(explored / "run.yaml"),
        "--drawing",
        str(DRAWING),
    ]
    assert main([*arguments, "-o", str(again), "--quiet"]) == 0
    first_line = (explored / "run.yaml").read_text().splitlines()[0]
    assert first_line == f"# gridslam map log.mcap -c run.yaml --drawing {DRAWING.name} -o DIR"
    for name in ("map.pgm", "map.yaml", "trajectory.tum", "lines.csv"):
        assert (again / name).read_bytes() == (explored / name).read_bytes(), name


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["hand-corridor-20", "--drawing", "missing.png"], 2, "missing.png"),
        (["hand-corridor-20", "--drawing", str(DRAWING), "-c", "slam-sd"], 2, "handmap-slam"),
        (["ir-room", "--drawing", str(DRAWING)], 2, "sensors.lidar"),
        (
            ["hand-corridor-20", "--drawing", str(DRAWING), "--start-in-drawing", "here"],
            2,
            "--start-in-drawing",
        ),
        (["hand-corridor-20", "--drawing", str(DRAWING), "--start-in-drawing", "99,0,0"], 2, "outside"),
    ],
)
def test_an_exploration_that_cannot_start_is_a_one_line_error(
    arguments: list[str], code: int, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explore", *arguments, "-o", str(tmp_path / "run")]) == code
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") <= 2
    assert not (tmp_path / "run").exists()


def test_an_exploration_over_the_time_limit_is_written_and_exits_with_4(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "run"
    arguments = [
        "explore",
        "hand-corridor-20",
        "--drawing",
        str(DRAWING),
        "-o",
        str(output),
        "--longest",
        "8",
    ]
    assert main([*arguments, "--start-in-drawing", START, "--quiet"]) == 4
    assert "--longest" in capsys.readouterr().err
    facts = json.loads((output / "report.json").read_text())["measures"]["exploration"]
    assert facts["ended"] == "time"
    assert (output / "log.mcap").exists()


def test_events_are_released_in_the_order_of_their_stamps_after_the_delay() -> None:
    order = InStampOrder(delay_ns=100)
    for stamp in (50, 30, 60, 30):
        order.add(Odometry(stamp, "odom", float(stamp), 0.0, 0.0))
    assert [e.stamp_ns for e in order.ready(130)] == [30, 30]
    assert [e.stamp_ns for e in order.ready(155)] == [50]
    assert [e.stamp_ns for e in order.rest()] == [60]


def test_without_the_drawing_that_the_method_needs_nothing_is_explored(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explore", "hand-round", "-o", str(tmp_path / "run"), "--quiet"]) == 2
    assert "--drawing FILE: handmap-slam needs it" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_without_a_start_the_robot_is_localized_in_the_drawing_and_explores(tmp_path: Path) -> None:
    # A round hall: only irregularities of the drawing distinguish the directions, and any of them will do.
    drawing = DRAWING.with_name("round.png")
    arguments = ["explore", "hand-round", "--drawing", str(drawing), "-o", str(tmp_path / "run"), "--quiet"]
    assert main(arguments) == 0
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    facts = report["measures"]["exploration"]
    assert facts["ended"] == "finished"
    assert facts["min_clearance_m"] > 0.0
    assert report["measures"]["drawing"]["matches_place"]
    assert report["errors"]["ape"]["trans"]["rmse"] < 0.05


def test_the_correction_takes_the_robot_to_the_end_of_a_corridor_that_is_drawn_too_short(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    completeness = {}
    for corrected in ("true", "false"):
        output = tmp_path / corrected
        arguments = ["explore", "hand-corridor-35", "--drawing", str(DRAWING), "-c", "paper/handmap-slam"]
        arguments += [
            "--start-in-drawing",
            START,
            "--world",
            "sensors.lidar.range_max_m=8",
            "--world-seed",
            "100",
        ]
        arguments += [
            "--set",
            f"method.correction={corrected}",
            "--seed",
            "100",
            "-o",
            str(output),
            "--quiet",
        ]
        assert main(arguments) == 0
        capsys.readouterr()
        assert main(["evaluate", str(output), "--json"]) == 0
        completeness[corrected] = json.loads(capsys.readouterr().out)["map"]["completeness"]["mean"]
    # 25 m are drawn. With a lidar of 8 m at the drawn end, more than 6 m of both walls and the end wall are not mapped.
    assert completeness["true"] < 0.1
    assert completeness["false"] > 5.0 * completeness["true"]
