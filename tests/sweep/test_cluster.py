"""A sweep on a Dask cluster that the test starts on this machine."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from gridslam.cli.main import main
from gridslam.core.errors import ConfigError
from gridslam.sweep import cluster as cluster_module
from gridslam.sweep.cluster import run_on_cluster
from tests.sweep.test_local import command, tables, wait_until

pytest.importorskip("distributed", reason="Dask is not installed: pip install 'gridslam[dask]'")

ENVIRONMENT = {
    **os.environ,
    "DASK_DISTRIBUTED__DASHBOARD__LINK": "",
    "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "30s",
    "NUMBA_NUM_THREADS": "1",
}


@contextmanager
def started(log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A `dask` command that is ended with the block; what it says goes to a file."""
    with (
        log.open("wb") as stream,
        subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            stdout=stream,
            stderr=stream,
            env=ENVIRONMENT,
            cwd=log.parent,
        ) as process,
    ):
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


class Cluster:
    """A scheduler, and workers by name."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self.stack = folder, stack
        log = folder / "scheduler.log"
        options = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self.scheduler = stack.enter_context(started(log, "scheduler", *options))
        wait_until(lambda: re.search(rb"Scheduler at:\s+(tcp://\S+)", log.read_bytes()))
        found = re.search(rb"Scheduler at:\s+(tcp://\S+)", log.read_bytes())
        assert found is not None
        self.address = found[1].decode()

    def add_worker(self, name: str) -> subprocess.Popen[bytes]:
        log = self.folder / f"{name}.log"
        options = ("--no-nanny", "--nthreads", "1", "--name", name, "--no-dashboard")
        worker = self.stack.enter_context(started(log, "worker", self.address, *options))
        wait_until(lambda: b"Registered to" in log.read_bytes())
        return worker


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler on loopback, without workers."""
    with ExitStack() as stack:
        yield Cluster(tmp_path, stack)


@pytest.mark.usefixtures("sweeps_here")
def test_a_worker_killed_in_mid_run_loses_nothing(sweep_file: Path, tmp_path: Path, cluster: Cluster) -> None:
    output = tmp_path / "out"
    first = cluster.add_worker("first")
    with subprocess.Popen(
        command(sweep_file, "-o", output, "--scheduler", cluster.address),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        # It has ended one run and is at the next
        wait_until(lambda: list(output.glob("records/**/*.json")) or process.poll() is not None)
        first.send_signal(signal.SIGKILL)
        cluster.add_worker("second")
        out, err = process.communicate(timeout=240)
    assert process.returncode == 0, err
    assert "3/3" in out
    assert main(["sweep", str(sweep_file), "-o", str(tmp_path / "local"), "--quiet"]) == 0
    assert tables(output) == tables(tmp_path / "local")


def test_a_scheduler_that_goes_away_is_reported(sweep_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    with ExitStack() as stack:
        gone = Cluster(tmp_path, stack)
        gone.add_worker("only")
        process = stack.enter_context(
            subprocess.Popen(
                command(sweep_file, "-o", output, "--scheduler", gone.address),
                stderr=subprocess.PIPE,
                text=True,
            )
        )
        wait_until(lambda: list(output.glob("records/**/*.json")) or process.poll() is not None)
        gone.scheduler.kill()
        _, err = process.communicate(timeout=120)
    assert process.returncode == 4
    assert "connection lost; the same command continues" in err
    assert "Traceback" not in err


def test_no_scheduler_at_the_address_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_S", 1)
    with pytest.raises(ConfigError, match="cannot be reached"):
        next(run_on_cluster([], "tcp://127.0.0.1:9", lambda: False))
