"""What is left behind when a run is interrupted, killed or loses its reader."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.conftest import program_command


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    """A run that takes some seconds and says when it has begun."""
    file = tmp_path / "slow.yaml"
    file.write_text("method: {name: dead-reckoning, sleep_s: 0.2, announce: true}\n")
    return file


@contextmanager
def running_map(log: Path, config: Path, output: Path) -> Iterator[subprocess.Popen[str]]:
    """A `map` process that has taken in its first scan."""
    command = program_command("map", log, "-c", config, "-o", output)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            assert process.stderr.readline() == "first scan\n"
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_writes_what_is_known_and_marks_it(
    small_log: Path, config_file: Path, tmp_path: Path, number: signal.Signals
) -> None:
    with running_map(small_log, config_file, tmp_path / "out") as process:
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted" in out
    assert "interrupted" in err
    assert "Traceback" not in err
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["status"] == "interrupted"
    assert 1 <= report["trajectory"]["poses"] < 60
    assert (tmp_path / "out" / "map.pgm").exists()


def test_a_kill_leaves_no_run_directory(small_log: Path, config_file: Path, tmp_path: Path) -> None:
    with running_map(small_log, config_file, tmp_path / "out") as process:
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=30)
    assert not (tmp_path / "out").exists()


def test_a_reader_that_went_away_costs_neither_result_nor_exit_code(
    small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    with running_map(small_log, config_file, tmp_path / "out") as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        process.send_signal(signal.SIGINT)
        err = process.stderr.read()
        assert process.wait(timeout=30) == 130
    assert "Traceback" not in err
    assert "Exception" not in err
    assert (tmp_path / "out" / "report.json").exists()
