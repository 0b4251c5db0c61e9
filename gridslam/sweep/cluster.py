"""A sweep's work on a Dask cluster that is running already."""

from __future__ import annotations

import logging
import queue
import threading
import uuid
from collections.abc import Iterator, Sequence
from typing import Any

from gridslam.core.errors import ConfigError, MethodError
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.work import Job, Stop, do

POLL_S = 0.2
CONNECT_S = 10

_NOISY = ("distributed", "tornado", "asyncio")
_one_at_a_time = threading.Lock()
_log = logging.getLogger(__name__)


def run_on_cluster(jobs: Sequence[Job], address: str, stop: Stop) -> Iterator[tuple[int, JobResult]]:
    """Do the jobs on the workers of a scheduler; the place of each in `jobs` and its result, as they end.

    Workers need this gridslam installed and the sweep's files under the same paths. The work of a worker that dies is
    done again by another one; work at which several workers have died one after the other (Dask's
    `distributed.scheduler.allowed-failures`) fails. Raises ConfigError: no Dask here, or no scheduler there;
    MethodError: the scheduler went away.
    """
    client = _connect(address)
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
    try:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            _log.warning("%s has no workers yet; waiting for them", address)
        sweep = uuid.uuid4().hex  # Dask would answer a key that it knows from memory
        places = {}
        for place, job in enumerate(jobs):
            future = client.submit(_do_on_worker, job, key=f"gridslam-{sweep}-{place}", pure=False)
            places[future.key] = place
            future.add_done_callback(ended.put)
        while places and not stop():
            try:
                future = ended.get(timeout=POLL_S)
            except queue.Empty:
                _refuse_lost(client, address)
                continue
            if future.status == "cancelled":
                raise MethodError(f"--scheduler {address}: lost; the same command goes on with what is left")
            yield places.pop(future.key), _result(future)
    finally:
        client.close()  # what was not begun is dropped with its futures


def _connect(address: str) -> Any:
    try:
        import distributed
    except ImportError:
        raise ConfigError(
            "--scheduler: Dask is not installed here; pip install 'gridslam[dask]', or leave it out and use --jobs"
        ) from None
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in _NOISY:  # what goes wrong is told in our own words
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
        raise MethodError(f"--scheduler {address}: lost; the same command goes on with what is left")


def _result(future: Any) -> JobResult:
    if future.status == "finished":
        result = future.result()
        assert isinstance(result, JobResult)
        return result
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return JobResult("failed", "the workers that were at it died (out of memory?)")
    return JobResult(
        "failed", f"the worker could not do it: {type(error).__name__}: {' '.join(str(error).split())}"
    )


def _do_on_worker(job: Job) -> JobResult:
    """One run at a time in a worker's process: numba's thread pool serves one caller. (`--nthreads 1` wastes nothing.)"""
    with _one_at_a_time:
        return do(job, lambda: False)
