"""Runs the jobs of a sweep in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import FrameType

from gridslam.core.processes import shielded_from_terminal
from gridslam.core.threads import threads_each
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.work import Job, Stop, execute

POLL_S = 0.2
EXIT_TIMEOUT_S = 5.0


def run_locally(jobs: Sequence[Job], processes: int, stop: Stop) -> Iterator[tuple[int, JobResult]]:
    """Run jobs in `processes` processes; yields the index and result of each job as it finishes.

    The processes share the machine's cores. If a process dies (for example out of memory), its job fails and a new process
    replaces it. All processes are ended when `stop` returns true or the generator is closed.
    """
    queue = deque(enumerate(jobs))
    count = min(processes, len(jobs))
    workers: list[_Worker] = []
    try:
        with threads_each(max(1, (os.cpu_count() or 1) // max(count, 1))):
            workers += [_Worker.start() for _ in range(count)]
            while (queue or any(w.job is not None for w in workers)) and not stop():
                for worker in workers:
                    if worker.job is None and queue:
                        worker.send(*queue.popleft())
                ready = wait([w.pipe for w in workers if w.job is not None], POLL_S)
                for place, worker in enumerate(workers):
                    if worker.pipe in ready and worker.job is not None:
                        job, result = worker.job, worker.result()
                        if worker.is_lost and stop():  # a signal to all processes of the sweep has ended it
                            return
                        yield job, result
                        if worker.is_lost:
                            worker.end()
                            workers[place] = _Worker.start()
    finally:
        for worker in workers:
            worker.end()


@dataclass(slots=True)
class _Worker:
    """A worker process, our end of the pipe to it, and the index of its current job, None if it is idle."""

    process: SpawnProcess
    pipe: Connection
    job: int | None = None
    is_lost: bool = False

    @staticmethod
    def start() -> _Worker:
        context = multiprocessing.get_context("spawn")
        parent_end, child_end = context.Pipe()
        process = context.Process(target=_serve, args=(child_end, os.getpid()), daemon=True)
        with shielded_from_terminal():
            process.start()
        child_end.close()  # so that the pipe ends when the process dies
        return _Worker(process, parent_end)

    def send(self, index: int, job: Job) -> None:
        """Send the process the job with this index."""
        self.job = index
        with suppress(OSError):  # it died while idle; `result` detects this
            self.pipe.send(job)

    def result(self) -> JobResult:
        """The result of the current job, when it is finished; if the process has died, a failure, and `is_lost` is set."""
        self.job = None
        try:
            result = self.pipe.recv()
        except (EOFError, OSError):
            self.is_lost = True
            self.process.join(EXIT_TIMEOUT_S)
            return JobResult("failed", _exit_reason(self.process.exitcode))
        assert isinstance(result, JobResult)
        return result

    def end(self) -> None:
        """End the process. A busy process is terminated, and killed if it has not cleaned up within EXIT_TIMEOUT_S."""
        self.pipe.close()
        if self.job is not None:
            self.process.terminate()
        self.process.join(EXIT_TIMEOUT_S)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def _exit_reason(exit_code: int | None) -> str:
    """The reason why a process ended, in words."""
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        why = " (out of memory? try fewer --jobs)" if -exit_code == signal.SIGKILL else ""
        return f"its process was ended by {name}{why}"
    return f"its process ended with exit code {exit_code}"


def _serve(pipe: Connection, parent: int) -> None:
    """The main function of a worker process: receives jobs and sends results until the pipe ends."""
    signal.signal(signal.SIGTERM, _exit)
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            pipe.send(execute(pipe.recv(), lambda: os.getppid() != parent))


def _exit(number: int, frame: FrameType | None) -> None:
    sys.exit(128 + number)  # raises SystemExit, so that unfinished folders are removed
