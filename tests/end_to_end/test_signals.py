"""What is left behind when a run is interrupted, killed or loses its reader."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gridslam import cli
from gridslam.cli.interruption import finishing, stop_on_signals
from gridslam.logs import write_log
from gridslam.report.directory import new_run_directory
from tests.conftest import REPOSITORY, program_command


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


@pytest.mark.parametrize("number", cli.SIGNALS)
@pytest.mark.parametrize("times", [1, 2])
def test_a_signal_writes_what_is_known_and_marks_it_also_if_it_is_sent_twice_at_once(
    small_log: Path, config_file: Path, tmp_path: Path, number: signal.Signals, times: int
) -> None:
    with running_map(small_log, config_file, tmp_path / "out") as process:
        for _ in range(times):
            process.send_signal(number)
            time.sleep(0.01)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted" in out
    assert "interrupted" in err
    assert "Traceback" not in err
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["status"] == "interrupted"
    assert 1 <= report["trajectory"]["poses"] < 60
    assert (tmp_path / "out" / "map.pgm").exists()


def test_a_second_signal_a_while_later_leaves_nothing(
    small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    with running_map(small_log, config_file, tmp_path / "out") as process:
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        assert "stopping" in process.stderr.readline()
        process.send_signal(signal.SIGSTOP)  # or it would be done before the second one
        time.sleep(cli.AT_ONCE_S)
        process.send_signal(signal.SIGTERM)
        process.send_signal(signal.SIGCONT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, "")
    assert err.splitlines()[-1] == "gridslam: error: interrupted; nothing was written"
    assert [path.name for path in tmp_path.iterdir() if "out" in path.name] == []


def test_a_hangup_that_the_parent_ignores_is_ignored(
    small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # what nohup does; children inherit it
    try:
        with running_map(small_log, config_file, tmp_path / "out") as process:
            process.send_signal(signal.SIGHUP)
            time.sleep(cli.AT_ONCE_S)
            process.send_signal(signal.SIGINT)  # would be the second one, and discard the result
            process.communicate(timeout=30)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert process.returncode == 130
    assert (tmp_path / "out" / "report.json").exists()


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


@contextmanager
def writing(output: Path, *arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    """A command that has begun to write beside `output`."""
    command = program_command(*arguments)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            while process.poll() is None and not list(output.parent.glob(f".{output.name}.*")):
                time.sleep(0.01)
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", cli.SIGNALS)
@pytest.mark.parametrize("name", ["out", "out.mcap"])
def test_a_signal_ends_a_simulation_in_one_line_and_leaves_nothing(
    tmp_path: Path, name: str, number: signal.Signals
) -> None:
    output = tmp_path / name
    with writing(output, "simulate", "office", "-o", output, "-q") as process:
        time.sleep(0.5)
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, "")
    assert err == "gridslam: error: interrupted; nothing was written\n"
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_exploration_leaves_is_removed_by_the_next_run(tmp_path: Path) -> None:
    output = tmp_path / "out"
    drawing = REPOSITORY / "configs" / "worlds" / "drawings" / "corridor.png"
    with writing(output, "explore", "hand-corridor-20", "--drawing", drawing, "-o", output) as process:
        process.kill()
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))
    with new_run_directory(output):
        pass
    assert list(tmp_path.iterdir()) == [output]


def test_what_a_killed_writer_leaves_is_removed_by_the_next(tmp_path: Path) -> None:
    output = tmp_path / "out.mcap"
    with writing(output, "simulate", "office", "-o", output) as process:
        process.kill()
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))
    write_log(output, [])
    assert list(tmp_path.iterdir()) == [output]


def test_no_file_takes_the_place_of_a_closed_stream() -> None:
    code = (
        "import atexit, os, sys\n"
        "os.close(2)\n"
        "atexit.register(lambda: print(os.readlink('/proc/self/fd/2')))\n"
        "sys.argv = ['gridslam', '--version']\n"
        "from gridslam.cli import run; run()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stdout.splitlines()[1:] == ["/dev/null"]


def test_ctrl_c_while_the_program_is_loaded_is_one_line() -> None:
    code = (
        "import sys\n"
        "class Press:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Press())\n"
        "from gridslam.cli import run; run()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "gridslam: error: interrupted\n")
    assert '\ngridslam = "gridslam.cli:run"\n' in (REPOSITORY / "pyproject.toml").read_text()


@pytest.mark.parametrize("number", cli.SIGNALS)
def test_a_signal_after_the_work_is_done_changes_nothing(number: signal.Signals) -> None:
    code = (
        "import atexit, os, sys\n"
        f"atexit.register(lambda: os.kill(os.getpid(), {number:d}))\n"
        "sys.argv = ['gridslam', '--version']\n"
        "from gridslam.cli import run; run()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("gridslam ")


@pytest.mark.parametrize("number", cli.SIGNALS)
def test_signals_come_too_late_while_the_result_is_shown(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with finishing():
        os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


def test_a_signal_before_anything_was_asked_ends_at_once_and_later_ones_stop_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cli, "AT_ONCE_S", 0.0)
    with stop_on_signals() as stop:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        assert not stop()
        os.kill(os.getpid(), signal.SIGTERM)
        assert stop()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)


def test_a_signal_that_is_repeated_at_once_does_not_disturb_what_the_first_one_has_begun(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cli, "_obeyed_s", -cli.AT_ONCE_S)
    with pytest.raises(KeyboardInterrupt):
        cli.interrupt(signal.SIGINT, None)
    cli.interrupt(signal.SIGINT, None)
    monkeypatch.setattr(cli, "AT_ONCE_S", 0.0)
    with pytest.raises(KeyboardInterrupt):
        cli.interrupt(signal.SIGINT, None)


def test_the_process_ends_with_all_its_output_and_takes_nothing_apart() -> None:
    code = (
        "import sys\n"
        "class Kept:\n"
        "    def __del__(self): print('taken apart')\n"
        "kept = Kept()\n"
        "print('before', end='')\n"
        "sys.argv = ['gridslam', 'no-such-command']\n"
        "from gridslam.cli import run; run()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout) == (2, "before")
