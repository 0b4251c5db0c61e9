"""A sweep on real processes: they share the work, and a death among them costs one run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gridslam.cli.main import main

TABLES = ("runs.csv", "runs.json", "summary.csv", "summary.json")


def command(*arguments: str | Path) -> list[str]:
    return [str(Path(sys.executable).with_name("gridslam")), "sweep", *map(str, arguments)]


def sweep(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*arguments), capture_output=True, text=True, timeout=240)


def children(pid: int) -> list[int]:
    """The working processes of a sweep (its resource tracker aside)."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(c) for c in found if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def eventually(found: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not found():
        assert time.monotonic() < end, "it never came to that"
        time.sleep(0.02)


def tables(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in TABLES}


def leftovers(folder: Path) -> Iterator[Path]:
    """Folders of runs that were begun and not finished."""
    return (path for path in folder.rglob(".*") if path.is_dir())


@pytest.mark.usefixtures("sweeps_here")
def test_a_killed_process_fails_its_run_only_and_the_next_sweep_makes_it_again_as_any_number_of_processes_would(
    sweep_file: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--jobs", "1", "--json"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        eventually(lambda: (output / "records").exists() and children(process.pid))
        os.kill(children(process.pid)[0], signal.SIGKILL)
        out, err = process.communicate(timeout=240)
    document = json.loads(out)
    assert process.returncode == 4, err
    assert document["runs"] == {"done": 2, "failed": 1, "not_run": 0}
    assert "ended by SIGKILL (out of memory?" in document["failed"][0]["error"]
    assert "Traceback" not in err
    again = sweep(sweep_file, "-o", output, "--jobs", "1")
    assert again.returncode == 0
    assert "2 of 3 are already done" in again.stderr
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "undisturbed"), "--quiet"]) == 0
    assert tables(output) == tables(tmp_path / "undisturbed")


def test_a_signal_ends_the_sweep_and_keeps_what_is_done(sweep_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--jobs", "1"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        eventually(lambda: list(output.glob("records/**/*.json")) or process.poll() is not None)
        team = children(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "the same command continues" in err
    assert "Traceback" not in err
    assert not any(Path(f"/proc/{pid}").exists() for pid in team)
    assert not list(leftovers(output))


def test_a_killed_sweep_takes_its_processes_with_it(sweep_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--jobs", "2"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        eventually(lambda: len(children(process.pid)) == 2)
        team = children(process.pid)
        process.kill()
    assert len(team) == 2
    eventually(lambda: not any(Path(f"/proc/{pid}").exists() for pid in team), 60.0)
    assert not (output / "summary.json").exists()
    # So the next one goes on
    assert json.loads((output / "sweep.json").read_bytes())["format"] == "gridslam sweep"
