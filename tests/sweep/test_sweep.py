"""What a sweep does, does not do twice, and writes."""

from __future__ import annotations

import csv
import json
import os
import shutil
from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.report.directory import is_run_directory
from gridslam.sweep.records import sweep_directory
from tests.sweep.conftest import Bench


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_every_combination_is_run_and_measured(bench: Bench) -> None:
    result = bench.run(
        overrides={"fine": ["method.resolution_m=0.05"], "coarse": ["method.resolution_m=0.2"]}
    )
    lines = table(bench.output / "runs.csv")
    assert [(row["log"], row["config"], row["override"], row["seed"]) for row in lines] == [
        ("room", "plain", override, str(seed)) for override in ("fine", "coarse") for seed in (0, 1, 2)
    ]
    # The log's truth is its odometry, which is what the method believes.
    assert all(float(row["ape.trans.rmse"]) < 1e-6 for row in lines)
    assert [group.done for group in result.groups] == [3, 3]
    run = bench.output / "runs" / "room" / "plain" / "fine" / "seed-1"
    assert is_run_directory(run)
    assert "resolution_m: 0.05" in (run / "run.yaml").read_text()
    assert "seed: 1" in (run / "run.yaml").read_text()


def test_tables_do_not_depend_on_the_order_in_which_runs_end(bench: Bench) -> None:
    bench.run()
    forward = bench.tables()
    shutil.rmtree(bench.output)
    bench.run(order=lambda places: places[::-1])
    assert bench.tables() == forward


def test_what_is_done_is_not_done_twice(bench: Bench) -> None:
    bench.run()
    first = bench.tables()
    result = bench.run()
    assert bench.ran == []
    assert bench.reported == ["3 of 3 are already done"]
    assert bench.tables() == first
    assert len(result.rows) == 3


def test_an_interrupted_sweep_continues_where_it_stopped(bench: Bench) -> None:
    result = bench.run(max_jobs=2)
    assert result.is_interrupted
    assert json.loads((bench.output / "summary.json").read_text())["status"] == "interrupted"
    assert [row["state"] for row in table(bench.output / "runs.csv")] == ["done", "done", "not run"]
    assert not bench.run().is_interrupted
    assert bench.ran == ["room plain default seed 2"]


def test_more_seeds_run_only_what_is_new(bench: Bench) -> None:
    bench.run(seeds="0..1")
    bench.run(seeds=[1, 5])
    assert bench.ran == ["room plain default seed 5"]


def test_a_changed_config_runs_its_own_runs_again(bench: Bench) -> None:
    (bench.folder / "other.yaml").write_text("method: {name: dead-reckoning, particles: 20}\n")
    configs = ["plain.yaml", "other.yaml"]
    bench.run(configs=configs, seeds=0)
    (bench.folder / "other.yaml").write_text("method: {name: dead-reckoning, particles: 30}\n")
    bench.run(configs=configs, seeds=0)
    assert bench.ran == ["room other default seed 0"]


def test_a_comment_in_a_config_runs_nothing_again(bench: Bench) -> None:
    bench.run(seeds=0)
    (bench.folder / "plain.yaml").write_text("# as before\nmethod: {name: dead-reckoning}\n")
    bench.run(seeds=0)
    assert bench.ran == []


def test_a_changed_log_runs_its_own_runs_again(bench: Bench, small_log: Path) -> None:
    copy = bench.folder / "copy"
    shutil.copytree(small_log, copy)
    bench.logs.append({"log": "copy"})
    bench.run(seeds=0)
    lines = (copy / "odom.csv").read_text().splitlines()
    (copy / "odom.csv").write_text("\n".join(lines[:-1]) + "\n")
    bench.run(seeds=0)
    assert bench.ran == ["copy plain default seed 0"]


def test_another_truth_measures_again_but_does_not_run_again(bench: Bench) -> None:
    bench.run(seeds=0)
    truth = bench.output / "runs/room/plain/default/seed-0/trajectory.tum"
    moved = [line.split() for line in truth.read_text().splitlines()]
    text = "\n".join(" ".join([t, str(1.1 * float(x)), *rest]) for t, x, *rest in moved)
    (bench.folder / "moved.tum").write_text(text)
    bench.logs[0]["truth"] = "moved.tum"
    result = bench.run(seeds=0)
    assert bench.ran == ["room plain default seed 0 (measured)"]
    assert result.rows[0].measures["ape.trans.rmse"] > 0.01


def test_a_run_directory_that_was_deleted_is_made_again(bench: Bench) -> None:
    bench.run(seeds="0..1")
    shutil.rmtree(bench.output / "runs/room/plain/default/seed-1")
    bench.run(seeds="0..1")
    assert bench.ran == ["room plain default seed 1"]


@pytest.mark.parametrize("kind", ["method", "bug"])
def test_a_run_that_fails_is_listed_and_the_others_go_on(bench: Bench, kind: str) -> None:
    overrides = {"good": [], "bad": [f"method.fail={kind}"]}
    result = bench.run(overrides=overrides, seeds=0)
    assert [row.result.state for row in result.rows] == ["done", "failed"]
    assert [row.label for row in result.failed] == ["room plain bad seed 0"]
    assert result.failed[0].result.error
    assert not (bench.output / "runs/room/plain/bad/seed-0").exists()
    assert result.document["failed"][0]["run"] == "room plain bad seed 0"
    bench.run(overrides=overrides, seeds=0)
    assert bench.ran == ["room plain bad seed 0"], "a failure is tried again"


def test_a_failed_run_is_no_success_and_its_group_says_so(bench: Bench) -> None:
    (bench.folder / "fails.yaml").write_text("method: {name: dead-reckoning, fail: method}\n")
    result = bench.run(
        configs=["plain.yaml", "fails.yaml"], seeds=0, successes={"near": ["ape.trans.rmse<=0.01"]}
    )
    rates = [group.measures["success.near"].statistic("rate") for group in result.groups]
    assert rates == [1.0, 0.0]
    assert [group.measures["run.done"].statistic("rate") for group in result.groups] == [1.0, 0.0]


def test_worlds_are_simulated_once_for_each_seed(bench: Bench) -> None:
    bench.take_world()
    result = bench.run(seeds="0..1", overrides={"a": [], "b": ["method.particles=5"]})
    simulated = ["hall seed 0", "hall seed 1"]
    assert bench.ran[:2] == simulated
    assert len(bench.ran) == 2 + 4
    assert not result.failed
    assert all(row.measures["ape.count"] > 0 for row in result.rows)
    logs = [(bench.output / "logs" / "hall" / f"seed-{seed}" / "log.mcap").read_bytes() for seed in (0, 1)]
    assert logs[0] != logs[1]
    bench.run(seeds="0..1", overrides={"a": []})
    assert bench.ran == []


def test_localize_in_worlds_is_given_the_true_map(bench: Bench) -> None:
    bench.take_world()
    result = bench.run(command="localize", seeds=0)
    assert [row.result.error for row in result.failed] == []
    assert "localization.success" in result.rows[0].measures


def test_a_world_that_cannot_be_simulated_fails_its_runs_only(bench: Bench) -> None:
    room = bench.logs[0]
    bench.logs = [{"world": "sd-corridor-short", "world_set": ["truth.resolution_m=0.00001"]}, room]
    result = bench.run(seeds=0)
    assert [row.result.state for row in result.rows] == ["failed", "done"]
    assert "the simulation of its log failed" in result.rows[0].result.error


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"logs": [{"log": "nowhere.mcap"}]}, "nowhere.mcap: cannot be read"),
        ({"logs": [{"log": "plain.yaml", "truth": "nowhere"}]}, "nowhere: no such file"),
        ({"configs": ["nothing.yaml"]}, "neither a config file nor a built-in name"),
        ({"overrides": {"a": ["method.partciles=3"]}}, "did you mean 'particles'"),
        ({"command": "localize"}, "room: map: this key is missing; dead-reckoning localizes on a map"),
        ({"command": "localize", "configs": ["slam-sd"]}, "slam-sd has no `gridslam localize`"),
        ({"logs": [{"world": "no-such-world"}]}, "neither a world file nor a built-in world"),
    ],
)
def test_what_is_wrong_is_reported_before_anything_is_run(bench: Bench, changes: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        bench.run(**changes)
    assert bench.ran == []
    assert not bench.output.exists()


def test_a_folder_that_is_no_sweep_is_left_alone(bench: Bench) -> None:
    bench.output.mkdir()
    (bench.output / "thesis.txt").write_text("all of it")
    with pytest.raises(ConfigError, match="is not the directory of a sweep"):
        bench.run()
    assert [path.name for path in bench.output.iterdir()] == ["thesis.txt"]


def test_two_sweeps_do_not_work_in_one_folder(tmp_path: Path) -> None:
    with (
        sweep_directory(tmp_path / "out"),
        pytest.raises(ConfigError, match="another sweep"),
        sweep_directory(tmp_path / "out"),
    ):
        pass


def test_what_a_killed_process_left_half_written_is_removed(bench: Bench) -> None:
    bench.run(seeds=0)
    half = bench.output / "runs/room/plain/default/.seed-0.abc.partial"
    half.mkdir()
    (half / "map.pgm").write_bytes(b"P5")
    bench.run(seeds=0)
    assert not half.exists()


@pytest.mark.parametrize("text", ["", "{", '{"key": 3}', "[]"])
def test_a_damaged_record_means_that_the_run_is_made_again(bench: Bench, text: str) -> None:
    bench.run(seeds=0)
    (bench.output / "records/runs/room/plain/default/seed-0.json").write_text(text)
    bench.run(seeds=0)
    assert bench.ran == ["room plain default seed 0"]


@pytest.mark.parametrize("value", [[1], 10**400, "\ud800"])
def test_a_record_of_what_no_table_holds_is_none(bench: Bench, value: object) -> None:
    bench.run(seeds=0)
    record = bench.output / "records/runs/room/plain/default/seed-0.json"
    document = json.loads(record.read_text())
    record.write_text(json.dumps({**document, "measures": {**document["measures"], "a": value}}))
    bench.run(seeds=0)
    assert bench.ran == ["room plain default seed 0"]


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_reported(bench: Bench) -> None:
    bench.folder.chmod(0o500)
    try:
        with pytest.raises(ConfigError, match="cannot be written"):
            bench.run()
    finally:
        bench.folder.chmod(0o700)
