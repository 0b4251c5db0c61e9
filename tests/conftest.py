"""Shared fixtures: real logs, a small log, and the program in this process or in one of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from gridslam.cli.main import main
from gridslam.methods import registry
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.work import Job, Stop, execute
from tests.dead_reckoning import register
from tests.small_log import write_small_log

REPOSITORY = Path(__file__).resolve().parent.parent

# A shell ignores SIGINT for what runs in the background, and `nohup` SIGHUP: the programs that tests start would inherit that.
for _number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, signal.default_int_handler if _number is signal.SIGINT else signal.SIG_DFL)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The real logs: GRIDSLAM_DATA, or shared/data beside the checkout; tests are skipped without them."""
    folder = Path(os.environ.get("GRIDSLAM_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real logs: {folder} is not there; set GRIDSLAM_DATA")
    return folder


@pytest.fixture(scope="session")
def cases_dir() -> Path:
    """Inputs with known faults: GRIDSLAM_CASES, or shared/cases beside the checkout; tests are skipped without them."""
    folder = Path(os.environ.get("GRIDSLAM_CASES", REPOSITORY.parent / "shared" / "cases"))
    if not folder.is_dir():
        pytest.skip(f"no inputs with known faults: {folder} is not there; set GRIDSLAM_CASES")
    return folder


@pytest.fixture(scope="session")
def small_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A CSV folder of a robot that drives through a room: 60 scans, with the truth."""
    return write_small_log(tmp_path_factory.mktemp("logs") / "room")


Program = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def program(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Program:
    """Runs a command line in this process, which saves the imports; the test method `dead-reckoning` is registered."""
    monkeypatch.setattr(registry, "METHODS", register())

    def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        capsys.readouterr()
        words = [str(argument) for argument in arguments]
        code = main(words)
        shown = capsys.readouterr()
        return subprocess.CompletedProcess(words, code, shown.out, shown.err)

    return run


@pytest.fixture
def sweeps_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let sweeps do their jobs in this process, which saves the imports of others."""

    def do_here(jobs: Sequence[Job], processes: int, stop: Stop) -> Iterator[tuple[int, JobResult]]:
        return ((index, execute(job, stop)) for index, job in enumerate(jobs))

    monkeypatch.setattr("gridslam.sweep.local.run_locally", do_here)


@pytest.fixture(scope="session")
def process() -> Program:
    """Runs a command line as `program` does, but in a process of its own, with options of `subprocess.run`."""

    def run(*arguments: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            program_command(*arguments), **{"capture_output": True, "text": True, "timeout": 120, **options}
        )

    return run


def program_command(*arguments: str | Path) -> list[str]:
    """The program with the test method, as arguments for subprocess."""
    start = (
        f"import sys; sys.path.insert(0, {str(REPOSITORY)!r}); from tests.dead_reckoning import main; main()"
    )
    return [sys.executable, "-c", start, *map(str, arguments)]
