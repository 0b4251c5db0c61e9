"""A log and its conversions give the same run, byte for byte."""

from __future__ import annotations

import bz2
from itertools import islice
from pathlib import Path

import pytest

from tests.conftest import Program
from tests.end_to_end.test_reproducible import reproducible_files


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    file = tmp_path / "dr.yaml"
    file.write_text("method: {name: dead-reckoning}\n")
    return file


def mapped(program: Program, log: Path, config: Path, output: Path) -> dict[str, bytes]:
    """The reproducible files of a run, but run.yaml, which names the log."""
    done = program("map", log, "-c", config, "-o", output)
    assert done.returncode == 0, done.stderr
    return {name: data for name, data in reproducible_files(output).items() if name != "run.yaml"}


def converted(program: Program, log: Path, output: Path, *options: str) -> Path:
    done = program("convert", log, output, *options)
    assert done.returncode == 0, done.stderr
    return output


def test_csv_and_mcap_give_the_same_run(
    program: Program, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    mcap = converted(program, small_log, tmp_path / "log.mcap")
    csv = converted(program, mcap, tmp_path / "csv")
    runs = [
        mapped(program, log, config_file, tmp_path / name)
        for name, log in (("a", small_log), ("b", mcap), ("c", csv))
    ]
    assert "trajectory.tum" in runs[0]
    assert runs[0] == runs[1] == runs[2]


@pytest.mark.real_data
def test_a_real_carmen_log_and_its_conversions_give_the_same_run(
    program: Program, data_dir: Path, config_file: Path, tmp_path: Path
) -> None:
    carmen = tmp_path / "beginning.clf"
    with bz2.open(data_dir / "lidar" / "aces.clf.bz2") as log:
        carmen.write_bytes(b"".join(islice(log, 1500)))
    mcap = converted(program, carmen, tmp_path / "aces.mcap")
    csv = converted(program, carmen, tmp_path / "aces")
    runs = [
        mapped(program, log, config_file, tmp_path / name)
        for name, log in (("a", carmen), ("b", mcap), ("c", csv))
    ]
    assert runs[0] == runs[1] == runs[2]
