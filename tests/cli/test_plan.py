"""gridslam plan and gridslam correlation, from the command line."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gridslam.cli.main import main
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A walled room of 4 x 3 m, its upper right corner unknown."""
    probability = np.zeros((60, 80), np.float32)
    probability[[0, -1]] = probability[:, [0, -1]] = 1.0
    probability[52:, 72:] = np.nan
    return save_map(OccupancyGrid(probability, GridGeometry(0.05, (-1.0, -1.0))), tmp_path / "room")


def test_a_plan_is_a_table_of_segments(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(room), "--start", "0,0,0", "--goal", "2,1,1.57", "-q"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[0] == "kind"
    assert {line.split()[0] for line in lines[1 : lines.index("")]} <= {"line", "arc"}
    assert any(line.startswith("*") for line in lines)


def test_a_plan_is_one_json_document_with_timed_poses(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(room), "--start", "0,0,0", "--goal", "2,1", "--json", "-q"]) == 0
    document = json.loads(capsys.readouterr().out)
    poses = document["poses"]
    assert [poses[-1][key] for key in "xy"] == pytest.approx([2.0, 1.0])
    assert poses[-1]["t"] == pytest.approx(document["time_s"])
    assert all(a["t"] < b["t"] for a, b in pairwise(poses))
    # the speed is the way over the time
    xy, t = np.array([[p["x"], p["y"]] for p in poses]), np.array([p["t"] for p in poses])
    speed = np.array([p["speed"] for p in poses])
    mean = np.hypot(*np.diff(xy, axis=0).T) / np.diff(t)
    np.testing.assert_allclose(mean, 0.5 * (speed[1:] + speed[:-1]), atol=0.03)


def test_a_plan_is_written_with_its_picture_and_never_over_another(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    command = ["plan", str(room), "--start", "0,0,0", "--goal", "2,1,0", "-q", "-o", str(out)]
    assert main(command) == 0
    assert {p.name for p in out.iterdir()} == {"path.csv", "segments.csv", "path.png", "report.json"}
    with (out / "path.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(rows[-1][key]) for key in ("x", "y", "yaw", "speed")] == pytest.approx(
        [2, 1, 0, 0], abs=1e-6
    )
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    assert main(command) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--start", "0,0", "--goal", "2,1,0"], 2, "--start 0,0: expected x,y,yaw"),
        (["--start", "0,0,0", "--goal", "2,nan,0"], 2, "--goal 2,nan,0: expected"),
        (["--start", "0,0,0", "--goal", "9,9,0"], 4, "goal 9,9: lies outside the map"),
        (["--start", "0,0,0", "--goal", "2.8,1.8,0"], 4, "lies in an unknown cell"),
        (["--start", "0,0,0", "--goal", "2,1", "--radius", "-1"], 2, "robot radius -1"),
        (["--start", "0,0,0", "--goal", "2,1", "--radius", "0"], 2, "robot radius 0: expected a positive"),
        (["--start", "0,0,0", "--goal", "2,1", "--footprint", ""], 2, "footprint: expected 3 to 100 corners"),
        (["--start", "0,0,0", "--goal", "2,1", "--acceleration", "1e308"], 2, "from 0.001 to 1000"),
        (["--start", "0,0,0", "--goal", "2,1", "--acceleration", "1e-300"], 2, "from 0.001 to 1000"),
        (["--start", "0,0,0", "--goal", "2,1", "--min-radius", "0"], 2, "turn on the spot"),
        (["--start", "0,0,0", "--goal", "2,1", "--speed", "nan"], 2, "top_speed_mps"),
        (["--start", "0,0,0", "--goal", "2,1", "--footprint", "1,1 2"], 2, "--footprint"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    room: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    assert main(["plan", str(room), *arguments, "-q"]) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert printed.err.count("\n") == 1


def test_a_map_that_is_not_there_ends_with_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["plan", "--start", "0,0,0", "--goal", "1,1"], ["correlation"]):
        assert main([command[0], str(tmp_path / "no.yaml"), *command[1:], "-q"]) == 3
        assert "no.yaml" in capsys.readouterr().err


def test_unknown_cells_may_be_driven_on_when_asked(room: Path) -> None:
    assert main(["plan", str(room), "--start", "0,0,0", "--goal", "2.7,1.7", "--unknown", "free", "-q"]) == 0


def test_the_correlation_of_a_map_is_printed_and_drawn(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "curve.png"
    assert main(["correlation", str(room), "--json", "-o", str(picture), "--samples", "2000", "-q"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert 0.0 < document["r0"] < 1.0
    assert document["resolution_m"] == 0.05
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["correlation", str(room), "-o", str(picture), "-q"]) == 2


@pytest.mark.parametrize("samples", [1, 2])
def test_an_error_that_few_walks_do_not_determine_is_null(
    room: Path, capsys: pytest.CaptureFixture[str], samples: int
) -> None:
    # Its likelihood is flat
    command = [
        "correlation",
        str(room),
        "--samples",
        str(samples),
        "--seed",
        "18",
        "-q",
    ]
    assert main([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["standard_error"] is None
    assert main(command) == 0
    assert any(line.split() == ["standard_error", "-"] for line in capsys.readouterr().out.splitlines())
