from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import yaml

from gridslam.core.trajectory import Trajectory
from gridslam.maps.map_server import load_map
from gridslam.methods.base import RunResult
from gridslam.report.run_yaml import command_again
from gridslam.report.write import write_run
from gridslam.runs.run import Command, Run

VOLATILE = {"report.json", "report.html"}


def test_a_run_directory_holds_the_promised_files(finished_run: Run, tmp_path: Path) -> None:
    write_run(finished_run, tmp_path / "out")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "layers.npz",
        "map.pgm",
        "map.png",
        "map.yaml",
        "objects.csv",
        "report.html",
        "report.json",
        "run.yaml",
        "trajectory.tum",
    ]
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_the_same_run_written_twice_has_the_same_bytes(finished_run: Run, tmp_path: Path) -> None:
    write_run(finished_run, tmp_path / "a")
    write_run(finished_run, tmp_path / "b")
    for file in (tmp_path / "a").iterdir():
        if file.name not in VOLATILE:
            assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes(), file.name


def test_the_report_has_the_names_that_scripts_rely_on(finished_run: Run, tmp_path: Path) -> None:
    returned = write_run(finished_run, tmp_path / "out")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report.keys() == returned.keys()
    assert (report["format_version"], report["seed"], report["status"]) == (1, 5, "lossy")
    assert report["counts"]["scan"] == {"read": 7, "used": 3, "skipped": 4}
    assert report["counts"]["odom"] == {"read": 9, "used": 9, "skipped": 0}
    assert report["counts"]["skipped_by_reason"] == {"scan.nan": 2, "scan.too_short": 2}
    assert report["counts"]["lost"] == {"bytes": 1}
    assert report["timing"]["read_s"] == 0.5
    assert report["timing"]["process_s"] == 1.5
    assert report["timing"]["total_s"] == pytest.approx(2.0 + report["timing"]["write_s"])
    assert report["memory"]["peak_mb"] > 1
    assert report["inputs"] == [{"path": "room.mcap", "sha256": "ab" * 32}]
    assert report["measures"] == {"confidence": {"mean": 0.5, "worst": None}}
    assert report["errors"]["align"] == "se2"  # the truth is the path moved and unturned: no error is left
    assert report["errors"]["ape"]["trans"]["rmse"] == pytest.approx(0.0, abs=1e-9)
    assert report["trajectory"]["length_m"] == pytest.approx(3.0)
    assert report["trajectory"]["first_stamp"] == "1700000000.123456789"
    assert report["map"]["known_m2"] == pytest.approx(6 * 0.05**2)
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", report["version"])


def test_the_map_reads_back(finished_run: Run, tmp_path: Path) -> None:
    write_run(finished_run, tmp_path / "out")
    grid = load_map(tmp_path / "out" / "map.yaml")
    assert grid.geometry.origin_xy_m == (-1.25, 0.1)
    assert np.array_equal(np.isnan(grid.probability)[1:3, 1:4], [[False, False, True], [False, False, True]])


def test_run_yaml_holds_every_setting_and_the_versions(finished_run: Run, tmp_path: Path) -> None:
    write_run(finished_run, tmp_path / "out")
    document = yaml.safe_load((tmp_path / "out" / "run.yaml").read_text())
    assert document["method"]["resolution_m"] == 0.1
    assert document["seed"] == 5
    assert document["made_with"]["libraries"]["numpy"] == np.__version__


@pytest.mark.parametrize(
    ("command", "given", "expected"),
    [
        ("map", {}, "map log.mcap -c run.yaml -o DIR"),
        ("map", {"drawing": "my plan.png"}, "map log.mcap -c run.yaml --drawing 'my plan.png' -o DIR"),
        ("localize", {"map": "hall.yaml"}, "localize log.mcap -c run.yaml --map hall.yaml -o DIR"),
        ("localize", {}, "localize log.mcap -c run.yaml -o DIR"),
        ("explore", {"drawing": "plan.png"}, "map log.mcap -c run.yaml --drawing plan.png -o DIR"),
    ],
)
def test_run_yaml_begins_with_the_command_that_makes_the_run_again(
    finished_run: Run, command: Command, given: dict[str, str], expected: str
) -> None:
    run = replace(finished_run, command=command, given=given, log_path=Path("there/log.mcap"))
    assert command_again(run) == f"gridslam {expected}"


class _Page(HTMLParser):
    """Collects what a page would load from elsewhere, and its tags."""

    def __init__(self) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            is_own = (value or "").startswith(("data:", "#"))
            if name in ("src", "href", "xlink:href") and not is_own:
                self.outside.append(f"{tag} {name}={value}")


def test_the_page_is_one_file_that_loads_nothing_and_escapes_names(finished_run: Run, tmp_path: Path) -> None:
    write_run(finished_run, tmp_path / "out")
    text = (tmp_path / "out" / "report.html").read_text()
    page = _Page()
    page.feed(text)
    assert page.outside == []
    assert "script" not in page.tags
    assert page.tags.count("svg") == 4  # paths, position error, heading error, n_eff
    assert "&lt;room&gt; &amp; more.mcap" in text
    assert "<room>" not in text
    for word in ("lossy", "skipped 2 x scan nan", "scan.too_short", "Position error", "N eff", "matching"):
        assert word in text


def test_no_name_of_a_log_acts_on_the_page_or_on_a_terminal_that_shows_it(
    finished_run: Run, tmp_path: Path
) -> None:
    hostile = replace(finished_run.result, notes=["frame \x1b[2J \u202e \x9b \u2066"])
    write_run(replace(finished_run, result=hostile, problems=tuple(hostile.notes)), tmp_path / "out")
    text = (tmp_path / "out" / "report.html").read_text()
    assert r"frame \x1b[2J \u202e \x9b \u2066" in text
    assert not set(text) & set("\x1b\u202e\x9b\u2066")


def test_a_run_without_a_single_pose_is_written(finished_run: Run, tmp_path: Path) -> None:
    empty = replace(finished_run, result=RunResult(Trajectory.empty()), occupancy=None)
    write_run(empty, tmp_path / "out")
    assert (tmp_path / "out" / "trajectory.tum").read_bytes() == b""
    assert not (tmp_path / "out" / "map.pgm").exists()
    assert json.loads((tmp_path / "out" / "report.json").read_text())["map"] is None


def test_a_given_map_is_drawn_but_not_saved_again(finished_run: Run, tmp_path: Path) -> None:
    localized = replace(finished_run, result=replace(finished_run.result, occupancy=None, layers={}))
    write_run(localized, tmp_path / "out")
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert "map.png" in names
    assert not names & {"map.pgm", "map.yaml", "layers.npz"}
