"""Disks that are full, and places that cannot be written: one line, exit code 2, nothing left behind."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest

from tests.conftest import Program

LARGEST_FILE = 2_000  # bytes: a file that grows beyond it fails as it would on a full disk


def limit_files() -> None:
    """In the child: no file may become larger."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "plain.yaml"
    file.write_text("method: {name: dead-reckoning}\noutput: {viewer: true}\n")
    return file


@pytest.mark.parametrize("command", ["map", "convert", "convert to csv", "simulate"])
def test_a_full_disk_is_reported_in_one_line_and_leaves_nothing(
    process: Program, small_log: Path, config: Path, tmp_path: Path, command: str
) -> None:
    folder = tmp_path / "disk"
    folder.mkdir()
    arguments = {
        "map": ("map", small_log, "-c", config, "-o", folder / "out"),
        "convert": ("convert", small_log, folder / "out.mcap"),
        "convert to csv": ("convert", small_log, folder / "out"),
        "simulate": ("simulate", "sd-corridor-short", "-o", folder / "out.mcap"),
    }[command]
    done = process(*arguments, "-q", preexec_fn=limit_files)
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "File too large" in done.stderr
    assert str(folder / "out") in done.stderr
    assert ".partial" not in done.stderr
    assert sorted(path.name for path in folder.iterdir()) == []


def test_an_old_run_survives_a_full_disk(
    program: Program, process: Program, small_log: Path, config: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    assert program("map", small_log, "-c", config, "-o", output).returncode == 0
    before = {path.name: path.read_bytes() for path in output.iterdir()}
    done = process("map", small_log, "-c", config, "-o", output, "--force", preexec_fn=limit_files)
    assert done.returncode == 2
    assert {path.name: path.read_bytes() for path in output.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize("name", ["out.mcap", "out"])
def test_an_old_simulation_survives_a_disk_that_is_full_at_the_last_byte(
    process: Program, tmp_path: Path, name: str
) -> None:
    world = tmp_path / "world.yaml"
    world.write_text(
        "walls: [{rectangle: [0, 0, 4, 3]}]\nrobot: {start: [1, 1, 0], route: [[2, 1]]}\nsensors: {lidar: {}}\n"
    )
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ("simulate", world, "-o", folder / name, "-q")
    assert process(*command).returncode == 0
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    largest = max(before, key=lambda path: len(before[path]))
    assert name in str(largest)
    limit = len(before[largest]) - 1
    done = process(
        *command, "--force", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    assert done.returncode == 2
    assert done.stderr == f"gridslam: error: {folder / name}: File too large\n"
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_standard_output_is_reported(process: Program, small_log: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = process("info", small_log, stdout=full, capture_output=False, stderr=-1)
    assert done.returncode == 2
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_standard_error_leaves_the_exit_code_as_it_is(process: Program, tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = process("info", tmp_path / "nope", stderr=full, capture_output=False, stdout=-1)
    assert (done.returncode, done.stdout) == (3, "")


@pytest.mark.parametrize("place", ["/dev/full", "/proc/gridslam-out", "/dev/null/out"])
def test_what_is_no_place_for_a_folder_is_refused_before_the_run(
    program: Program, small_log: Path, config: Path, place: str
) -> None:
    done = program("map", small_log, "-c", config, "-o", place)
    assert done.returncode == 2
    assert place in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_a_folder_without_the_right_to_write_is_refused_before_the_run(
    program: Program, small_log: Path, config: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    done = program("map", small_log, "-c", config, "-o", folder / "out")
    assert done.returncode == 2
    assert "cannot be written" in done.stderr
