"""What a person at a terminal sees while a run goes on."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
from pathlib import Path

import pytest

from tests.conftest import program_command


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    """A run of a second."""
    file = tmp_path / "slow.yaml"
    file.write_text("method: {name: dead-reckoning, sleep_s: 0.02}\n")
    return file


def stderr_on_a_terminal(*arguments: str | Path, **environment: str) -> tuple[str, str]:
    """What the program writes to a terminal as stderr, and to a pipe as stdout."""
    here, terminal = pty.openpty()
    settings = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", **environment}
    with subprocess.Popen(
        program_command(*arguments), stdout=subprocess.PIPE, stderr=terminal, text=True, env=settings
    ) as process:
        os.close(terminal)
        shown = b""
        while chunk := _read(here):
            shown += chunk
        out = process.stdout.read() if process.stdout else ""
    os.close(here)
    return shown.decode(), out


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # Linux: the other end was closed
        return b""


def test_the_bar_shows_speed_and_remaining_time(small_log: Path, config_file: Path, tmp_path: Path) -> None:
    shown, out = stderr_on_a_terminal("map", small_log, "-c", config_file, "-o", tmp_path / "out")
    assert re.search(r"\d+ scans/s", shown)
    assert re.search(r"\d:\d\d:\d\d", shown)
    assert "60 poses" in out


def test_quiet_shows_nothing(small_log: Path, config_file: Path, tmp_path: Path) -> None:
    shown, _ = stderr_on_a_terminal("map", small_log, "-c", config_file, "-o", tmp_path / "out", "--quiet")
    assert shown == ""


def test_no_color_holds(small_log: Path, config_file: Path, tmp_path: Path) -> None:
    shown, _ = stderr_on_a_terminal("map", small_log, "-c", config_file, "-o", tmp_path / "out", NO_COLOR="1")
    assert "scans/s" in shown
    assert not re.search(r"\x1b\[[0-9;]*[3-9][0-7]m", shown)


def test_the_result_so_far_is_written_when_the_terminal_is_closed(small_log: Path, tmp_path: Path) -> None:
    config = tmp_path / "slow.yaml"
    config.write_text("method: {name: dead-reckoning, sleep_s: 0.2, announce: true}\n")
    command = program_command("map", small_log, "-c", config, "-o", tmp_path / "out")
    process, terminal = pty.fork()
    if not process:
        os.execv(command[0], command)
    shown = b""
    while b"first scan" not in shown:
        shown += os.read(terminal, 65536)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 130
    assert json.loads((tmp_path / "out" / "report.json").read_text())["status"] == "interrupted"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "slow.yaml"]
