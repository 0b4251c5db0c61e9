"""Runs the jobs of a sweep on a running Dask cluster."""

from __future__ import annotations

import logging
import queue
import threading
import uuid
from collections.abc import Iterator, Sequence
from typing import Any

from gridslam.core.errors import ConfigError, MethodError
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.work import Job, Stop, execute

POLL_S = 0.2
CONNECT_S = 10

_NOISY = ("distributed", "tornado", "asyncio")
_one_at_a_time = threading.Lock()
_log = logging.getLogger(__name__)


def run_on_cluster(jobs: Sequence[Job], address: str, stop: Stop) -> Iterator[tuple[int, JobResult]]:
    """Run jobs on the workers of a scheduler; yields the index and result of each job as it finishes.

    Workers need the same version of gridslam, and the sweep's files at the same paths. A job whose worker dies is repeated on
    another; a job that has killed several workers (Dask's `distributed.scheduler.allowed-failures`) fails. Raises ConfigError if
    Dask is not installed or the scheduler cannot be reached, and MethodError if the connection to the scheduler is lost.
    """
    client = _connect(address)
    finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
    try:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            _log.warning("%s has no workers yet; waiting for them", address)
        sweep = uuid.uuid4().hex  # unique keys: Dask would return a cached result for a known key
        indices = {}
        for index, job in enumerate(jobs):
            future = client.submit(_do_on_worker, job, key=f"gridslam-{sweep}-{index}", pure=False)
            indices[future.key] = index
            future.add_done_callback(finished.put)
        while indices and not stop():
            try:
                future = finished.get(timeout=POLL_S)
            except queue.Empty:
                _refuse_lost(client, address)
                continue
            if future.status == "cancelled":
                raise MethodError(
                    f"--scheduler {address}: connection lost; the same command continues the sweep"
                )
            yield indices.pop(future.key), _result(future)
    finally:
        client.close()  # drops the futures, and with them the jobs that have not started


def _connect(address: str) -> Any:
    try:
        import distributed
    except ImportError:
        raise ConfigError(
            "--scheduler: Dask is not installed here; pip install 'gridslam[dask]', or use --jobs instead"
        ) from None
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in _NOISY:  # errors are reported by this module
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        connect: Any = distributed.Client  # untyped
        return connect(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error) or type(error).__name__
        raise ConfigError(
            f"--scheduler {address}: cannot be reached ({reason}); start one with `dask scheduler`"
        ) from None


def _refuse_lost(client: Any, address: str) -> None:
    if client.status != "running":
        raise MethodError(f"--scheduler {address}: connection lost; the same command continues the sweep")


def _result(future: Any) -> JobResult:
    if future.status == "finished":
        result = future.result()
        assert isinstance(result, JobResult)
        return result
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return JobResult("failed", "its workers died (out of memory?)")
    return JobResult("failed", f"error on the worker: {type(error).__name__}: {' '.join(str(error).split())}")


def _do_on_worker(job: Job) -> JobResult:
    """Run a job, one at a time per process, since numba's thread pool serves one caller.

    Other threads of the worker wait, so workers started with `--nthreads 1` lose nothing.
    """
    with _one_at_a_time:
        return execute(job, lambda: False)
