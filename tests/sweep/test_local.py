"""A sweep on real processes. If one of them is killed, only its run fails."""

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


def workers_of(pid: int) -> list[int]:
    """The worker processes of a sweep, without Python's resource tracker."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(c) for c in found if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def wait_until(condition: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds:g} s"
        time.sleep(0.02)


def tables(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in TABLES}


def unfinished_runs(folder: Path) -> Iterator[Path]:
    """Folders of runs that were started and not finished."""
    return (path for path in folder.rglob(".*") if path.is_dir())


@pytest.mark.usefixtures("sweeps_here")
def test_a_killed_process_fails_only_its_run_and_the_next_sweep_gives_the_same_tables_as_an_undisturbed_one(
    sweep_file: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--jobs", "1", "--json"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        wait_until(lambda: (output / "records").exists() and workers_of(process.pid))
        os.kill(workers_of(process.pid)[0], signal.SIGKILL)
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


def test_a_signal_ends_the_sweep_and_keeps_finished_runs(sweep_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--jobs", "1"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        wait_until(lambda: list(output.glob("records/**/*.json")) or process.poll() is not None)
        workers = workers_of(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "the same command continues" in err
    assert "Traceback" not in err
    assert not any(Path(f"/proc/{pid}").exists() for pid in workers)
    assert not list(unfinished_runs(output))


def test_a_killed_sweep_takes_its_processes_with_it(sweep_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--jobs", "2"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        wait_until(lambda: len(workers_of(process.pid)) == 2)
        workers = workers_of(process.pid)
        process.kill()
    assert len(workers) == 2
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 60.0)
    assert not (output / "summary.json").exists()
    # The next sweep can continue, because the folder is still known to be that of a sweep.
    assert json.loads((output / "sweep.json").read_bytes())["format"] == "gridslam sweep"
