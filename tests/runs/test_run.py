from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import ConfigError, InputError, LogError, MapError, MethodError
from gridslam.methods import registry
from gridslam.methods.registry import MethodEntry
from gridslam.runs.feed import Progress
from gridslam.runs.run import Run, run_localize, run_map
from gridslam.runs.run_config import load_config
from tests.dead_reckoning import ENTRY, register
from tests.small_log import HALF_HEIGHT_M, HALF_WIDTH_M, START_NS

RunSmall = Callable[..., Run]


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    file = tmp_path / "dr.yaml"
    file.write_text("method: {name: dead-reckoning}\n")
    return file


@pytest.fixture
def run_small(small_log: Path, config_file: Path, monkeypatch: pytest.MonkeyPatch) -> RunSmall:
    """Maps the small log (or another) with the test method."""
    monkeypatch.setattr(registry, "METHODS", register())

    def run(log: Path = small_log, stop: Callable[[], bool] = lambda: False, **settings: object) -> Run:
        config = load_config(str(config_file), [f"method.{k}={v}" for k, v in settings.items()])
        return run_map(config, log, lambda progress: None, stop)

    return run


def test_every_scan_gets_a_pose_with_its_own_stamp(run_small: RunSmall) -> None:
    run = run_small()
    assert run.result.trajectory.stamps_ns.tolist() == [START_NS + k * 100_000_000 for k in range(60)]
    assert run.status == "complete"
    assert (run.counts.streams["scan"].read, run.counts.streams["scan"].used) == (60, 60)
    assert run.counts.streams["odom"].read == 60


def test_the_map_is_the_room(run_small: RunSmall) -> None:
    grid = run_small(resolution_m=0.1).result.occupancy
    assert grid is not None
    walls = grid.geometry.centres(np.argwhere(grid.probability > 0.5))
    off_x = np.abs(np.abs(walls[:, 0]) - HALF_WIDTH_M)
    off_y = np.abs(np.abs(walls[:, 1]) - HALF_HEIGHT_M)
    # Half a cell, and up to one more for float32 ranges at its edge
    assert np.minimum(off_x, off_y).max() <= 0.11


def test_the_truth_is_on_record_and_never_shown_to_the_method(run_small: RunSmall) -> None:
    run = run_small()
    assert run.truth is not None
    assert len(run.truth) == 60
    assert "truth" not in run.counts.streams


def with_truth(log: Path, folder: Path, tum: str) -> Path:
    """A copy of a log with its truth in a file beside it."""
    shutil.copytree(log, folder / "log")
    (folder / "log" / "truth.csv").unlink()
    (folder / "log.truth").mkdir()
    (folder / "log.truth" / "trajectory.tum").write_text(tum, encoding="utf-8")
    return folder / "log"


@pytest.mark.parametrize(
    "line",
    [
        "2 0 0",
        "2 nan 0 0 0 0 0 1",
        "2 0 inf 0 0 0 0 1",
        "2 1e200 0 0 0 0 0 1",
        "2 0 0 0 0 0 0 0",
        "soon 0 0 0 0 0 0 1",
    ],
)
def test_a_wrong_line_of_the_truth_ends_the_run_before_the_log_is_gone_through(
    run_small: RunSmall, small_log: Path, tmp_path: Path, line: str
) -> None:
    log = with_truth(small_log, tmp_path, f"1 0 0 0 0 0 0 1\n{line}\n")
    with pytest.raises(InputError, match=r"trajectory\.tum:2: "):
        run_small(log, fail="bug")  # at the first scan


@pytest.mark.parametrize(
    "tum", ["\ufeff1 2 3 0 0 0 0 1\n", "1 2 3 0\n", "# t x y\n1 2 3 0 0 0 0 1 # c\n", "1,2,3,0,0,0,0,1\n"]
)
def test_the_truth_beside_a_log_takes_what_evaluate_takes(
    run_small: RunSmall, small_log: Path, tmp_path: Path, tum: str
) -> None:
    truth = run_small(with_truth(small_log, tmp_path, tum)).truth
    assert truth is not None
    assert truth.poses.tolist() == [[2.0, 3.0, 0.0]]


def test_true_poses_of_a_stream_that_cannot_be_used_are_left_out_and_counted(
    run_small: RunSmall, small_log: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    shutil.copytree(small_log, log)
    rows = (log / "truth.csv").read_text().splitlines()
    for number, pose in ((3, "1e200,0,0"), (5, "nan,0,0"), (6, "0,-inf,0"), (9, "here,0,0")):
        rows[number] = f"{rows[number].partition(',')[0]},{pose}"
    (log / "truth.csv").write_text("\n".join(rows))
    run = run_small(log)
    assert run.truth is not None
    assert len(run.truth) == 56
    skipped = {"truth.too_far": 1, "truth.not_finite": 2, "truth.unreadable_row": 1}
    assert {key: n for key, n in run.counts.skipped_by_reason.items() if "truth" in key} == skipped
    assert [line for line in run.problems if "4 true poses cannot be used" in line]
    assert run.status == "complete"  # the method has lost nothing


def test_the_clock_covers_reading_and_processing(run_small: RunSmall) -> None:
    run = run_small(sleep_s=0.01)
    assert run.process_s >= 60 * 0.01
    assert 0.0 < run.read_s < 10.0


def test_progress_counts_events_and_scans_to_the_end(
    small_log: Path, config_file: Path, run_small: RunSmall
) -> None:
    shown: list[Progress] = []
    run_map(load_config(str(config_file)), small_log, shown.append, lambda: False)
    assert shown[-1].scans == 60
    assert shown[-1].events <= shown[-1].max_events
    assert [p.events for p in shown] == sorted(p.events for p in shown)


def test_a_stopped_run_keeps_what_it_has(run_small: RunSmall) -> None:
    asked = iter([False] * 4 + [True] * 1000)
    run = run_small(stop=lambda: next(asked))
    assert run.status == "interrupted"
    assert 0 < len(run.result.trajectory) < 60


def test_a_log_with_bad_messages_is_lossy_and_says_what_was_skipped(
    run_small: RunSmall, small_log: Path, tmp_path: Path
) -> None:
    log = shutil.copytree(small_log, tmp_path / "damaged")
    lines = (log / "odom.csv").read_text().splitlines()
    lines[10] = lines[10].rsplit(",", 1)[0] + ",nan"
    (log / "odom.csv").write_text("\n".join(lines) + "\n")
    run = run_small(log)
    assert (run.status, run.is_lossy) == ("lossy", True)
    assert run.counts.streams["odom"].skipped == 1
    assert sum(run.counts.skipped_by_reason.values()) == 1
    assert any("odom" in problem for problem in run.problems)


def test_a_result_that_the_method_doubts_has_a_status_of_its_own(run_small: RunSmall) -> None:
    run = run_small(fail="lost")
    assert run.status == "lost"
    assert run.result.doubt is not None


def test_a_result_without_a_pose_is_an_error_that_names_what_was_skipped(run_small: RunSmall) -> None:
    with pytest.raises(MethodError, match=r"found no pose \(skipped: 60 x scan\.too_short\)"):
        run_small(fail="no-pose")


def test_a_map_without_cells_is_an_error(run_small: RunSmall) -> None:
    with pytest.raises(MethodError, match="found a map without cells"):
        run_small(fail="empty-map")


def test_an_interrupted_run_may_be_empty(run_small: RunSmall) -> None:
    run = run_small(stop=lambda: True)
    assert run.status == "interrupted"
    assert not len(run.result.trajectory)


def test_a_missing_stream_is_named_with_what_the_log_has(
    run_small: RunSmall, small_log: Path, tmp_path: Path
) -> None:
    log = shutil.copytree(small_log, tmp_path / "blind")
    (log / "scan.csv").unlink()
    with pytest.raises(LogError, match=r"no scan stream.*odom"):
        run_small(log)


def test_a_method_without_the_command_is_refused_with_those_that_have_it(
    run_small: RunSmall, monkeypatch: pytest.MonkeyPatch
) -> None:
    only_localizes = MethodEntry(ENTRY.config, localizer=ENTRY.localizer, needs=ENTRY.needs)
    monkeypatch.setattr(registry, "METHODS", {**registry.METHODS, "dead-reckoning": only_localizes})
    with pytest.raises(
        ConfigError, match=r"dead-reckoning has no `gridslam map`; methods that have: .*slam-sd"
    ):
        run_small()


def test_localizing_records_the_map_among_the_inputs(
    run_small: RunSmall, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    from gridslam.maps.map_server import save_map

    made = run_small().result.occupancy
    assert made is not None
    map_path = save_map(made, tmp_path / "room")
    run = run_localize(load_config(str(config_file)), small_log, map_path, lambda p: None, lambda: False)
    assert run.command == "localize"
    assert run.occupancy is not None
    assert run.result.occupancy is None
    assert {"room.yaml", "scan.csv", "odom.csv"} <= set(run.inputs)


def test_a_map_that_is_too_large_to_localize_on_is_refused_before_it_is_read(
    run_small: RunSmall, small_log: Path, config_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gridslam.maps.map_server import save_map

    made = run_small().result.occupancy
    assert made is not None
    map_path = save_map(made, tmp_path / "room")
    monkeypatch.setattr("gridslam.runs.run.MAX_LOCALIZED_CELLS", 100)
    with pytest.raises(MapError, match="at most 100 are read: crop the map"):
        run_localize(load_config(str(config_file)), small_log, map_path, lambda p: None, lambda: False)
