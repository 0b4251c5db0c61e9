"""Same log, config and seed: same bytes; also from the run.yaml that a run leaves behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import REPOSITORY, Program

VOLATILE = {"report.json", "report.html"}


def reproducible_files(directory: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in directory.iterdir() if p.name not in VOLATILE}


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    file = tmp_path / "dr.yaml"
    file.write_text("method: {name: dead-reckoning, resolution_m: 0.07}\nlog: {order: stamp}\n")
    return file


def test_a_run_from_run_yaml_gives_the_same_bytes(
    program: Program, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    first = program(
        "map",
        small_log,
        "-c",
        config_file,
        "-o",
        tmp_path / "a",
        "--seed",
        "7",
        "--set",
        "method.particles=3",
    )
    assert first.returncode == 0, first.stderr
    second = program("map", small_log, "-c", tmp_path / "a" / "run.yaml", "-o", tmp_path / "b")
    assert second.returncode == 0, second.stderr
    files = reproducible_files(tmp_path / "a")
    assert {
        "map.pgm",
        "map.yaml",
        "map.png",
        "layers.npz",
        "trajectory.tum",
        "deviation.csv",
        "run.yaml",
    } == set(files)
    assert files == reproducible_files(tmp_path / "b")


def test_another_seed_gives_other_bytes(
    program: Program, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    for seed in ("1", "2"):
        done = program("map", small_log, "-c", config_file, "-o", tmp_path / seed, "--seed", seed)
        assert done.returncode == 0, done.stderr
    one, two = (reproducible_files(tmp_path / seed) for seed in ("1", "2"))
    assert one["deviation.csv"] != two["deviation.csv"]
    assert one["trajectory.tum"] == two["trajectory.tum"]


@pytest.mark.parametrize(
    ("verb", "method", "given"),
    [
        ("map", "slam-sd", ("--end", "260")),  # closes a loop
        ("map", "handmap-slam", ("--end", "40", "--drawing", "configs/worlds/drawings/corridor.png")),
        ("map", "ir-scan", ("--end", "30")),
        ("localize", "ispace-mcl", ("--end", "20", "--map", "sample_logs/ispace-mcl.truth/map.yaml")),
        ("map", "stereo-bayes", ("--end", "12")),
    ],
)
def test_the_number_of_threads_changes_no_byte(
    process: Program, program: Program, tmp_path: Path, verb: str, method: str, given: tuple[str, ...]
) -> None:
    log = REPOSITORY / "sample_logs" / f"{method}.mcap"
    files = [str(REPOSITORY / word) if "/" in word else word for word in given]
    # Libraries read the number when they are imported
    for run, jobs in (
        (process, ("--jobs", "1")),
        (program, ()),
    ):
        done = run(verb, log, "-c", method, *files, *jobs, "-o", tmp_path / str(len(jobs)))
        assert done.returncode == 0, done.stderr
    assert reproducible_files(tmp_path / "2") == reproducible_files(tmp_path / "0")
