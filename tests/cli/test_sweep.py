"""gridslam sweep: what is printed, and the exit code."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import yaml

from gridslam.cli.main import main
from gridslam.methods import registry
from gridslam.sweep import local
from gridslam.sweep.work import execute
from tests.dead_reckoning import register


@pytest.fixture
def sweep_file(tmp_path: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two runs of the test method, done in the tests' own process."""
    monkeypatch.setattr(registry, "METHODS", register())
    monkeypatch.setattr(
        local,
        "run_locally",
        lambda jobs, processes, stop: ((place, execute(job, stop)) for place, job in enumerate(jobs)),
    )
    (tmp_path / "plain.yaml").write_text("method: {name: dead-reckoning}\n")
    document = {
        "command": "map",
        "logs": [{"name": "room", "log": str(small_log), "truth": str(small_log)}],
        "configs": ["plain.yaml"],
        "seeds": "0..1",
    }
    path = tmp_path / "sweep.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


def change(path: Path, **changes: object) -> Path:
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), **changes}))
    return path


def test_the_table_has_a_line_for_each_group(
    sweep_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "out")]) == 0
    header, line = capsys.readouterr().out.splitlines()
    assert header.split()[:5] == ["log", "config", "override", "runs", "ape.trans.rmse"]
    assert line.split()[:4] == ["room", "plain", "default", "2/2"]


def test_json_is_the_summary(sweep_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "out"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert printed["groups"][0]["measures"]["ape.trans.rmse"]["n"] == 2


def test_a_gate_that_does_not_hold_ends_with_1(
    sweep_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change(sweep_file, require=["ape.count>=1000"])
    arguments = ["sweep", str(sweep_file), "-o", str(tmp_path / "out"), "-q"]
    assert main([*arguments, "--require", "max(run.length_m)<=1"]) == 1
    err = capsys.readouterr().err
    assert "room plain default seed 1: gate failed: ape.count = 60, required >= 1000" in err
    assert "max of run.length_m" in err


def test_a_run_that_fails_ends_with_4_and_is_named(
    sweep_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change(sweep_file, overrides={"good": [], "bad": ["method.fail=method"]}, seeds=0)
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "out"), "-q"]) == 4
    captured = capsys.readouterr()
    assert "error: room plain bad seed 0: the test method was asked to fail" in captured.err
    assert "0/1" in captured.out
    assert "1/1" in captured.out


@pytest.mark.parametrize(
    "further",
    [["--require", "nonsense"], ["--jobs", "2", "--scheduler", "tcp://127.0.0.1:1"], ["--jobs", "0"]],
)
def test_what_cannot_be_meant_ends_with_2(sweep_file: Path, tmp_path: Path, further: list[str]) -> None:
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "out"), *further]) == 2
    assert not (tmp_path / "out").exists()


def test_without_dask_the_scheduler_says_what_to_install(
    sweep_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    arguments = ["sweep", str(sweep_file), "-o", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:1"]
    assert main(arguments) == 2
    assert "pip install 'gridslam[dask]'" in capsys.readouterr().err


def test_a_pattern_of_logs_is_an_entry_for_each(
    sweep_file: Path, small_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one", "two"):
        (tmp_path / "logs" / name).mkdir(parents=True)
        for file in small_log.iterdir():
            (tmp_path / "logs" / name / file.name).write_bytes(file.read_bytes())
    change(sweep_file, logs=["logs/*", {"name": "drive", "log": "logs/*"}], seeds=[0])
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "out"), "--json"]) == 0
    groups = json.loads(capsys.readouterr().out)["groups"]
    assert [group["log"] for group in groups] == ["one", "two", "drive-one", "drive-two"]
