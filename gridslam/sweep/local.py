"""A sweep's work on processes of this machine."""

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

from gridslam.core.threads import threads_each
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.work import Job, Stop, do

POLL_S = 0.2
LEAVE_S = 5.0


def run_locally(jobs: Sequence[Job], processes: int, stop: Stop) -> Iterator[tuple[int, JobResult]]:
    """Do the jobs on so many processes; the place of each in `jobs` and its result, as they end.

    The machine's cores are divided among the processes. A process that dies (killed for want of memory) fails the job
    that it was at, and a new one takes its place. When `stop` says so, or the caller goes away, all are ended.
    """
    left = deque(enumerate(jobs))
    count = min(processes, len(jobs))
    team: list[_Worker] = []
    try:
        with threads_each(max(1, (os.cpu_count() or 1) // max(count, 1))):
            team += [_Worker.start() for _ in range(count)]
            while (left or any(w.job is not None for w in team)) and not stop():
                for worker in team:
                    if worker.job is None and left:
                        worker.give(*left.popleft())
                ready = wait([w.pipe for w in team if w.job is not None], POLL_S)
                for place, worker in enumerate(team):
                    if worker.pipe in ready and worker.job is not None:
                        job, result = worker.job, worker.result()
                        yield job, result
                        if worker.is_lost:
                            worker.end()
                            team[place] = _Worker.start()
    finally:
        for worker in team:
            worker.end()


@dataclass(slots=True)
class _Worker:
    """A process, our end of the pipe to it, and the place of the job that it is at."""

    process: SpawnProcess
    pipe: Connection
    job: int | None = None
    is_lost: bool = False

    @staticmethod
    def start() -> _Worker:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, os.getpid()), daemon=True)
        process.start()
        theirs.close()  # so that a dead process is the end of the pipe
        return _Worker(process, ours)

    def give(self, place: int, job: Job) -> None:
        self.job = place
        with suppress(OSError):  # it died while idle: the pipe's end tells so, in `result`
            self.pipe.send(job)

    def result(self) -> JobResult:
        self.job = None
        try:
            result = self.pipe.recv()
        except (EOFError, OSError):
            self.is_lost = True
            self.process.join(LEAVE_S)
            return JobResult("failed", _last_words(self.process.exitcode))
        assert isinstance(result, JobResult)
        return result

    def end(self) -> None:
        """An idle process goes by itself; one at work is told to, and has some seconds to tidy up."""
        self.pipe.close()
        if self.job is not None:
            self.process.terminate()
        self.process.join(LEAVE_S)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def _last_words(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        why = " (out of memory? fewer --jobs leave more to each)" if -exit_code == signal.SIGKILL else ""
        return f"its process was ended by {name}{why}"
    return f"its process ended with exit code {exit_code}"


def _serve(pipe: Connection, parent: int) -> None:
    """A process of the team: jobs in, results out, until the pipe ends.

    Ctrl-C reaches all processes of a terminal; what it means is for the parent to say.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            pipe.send(do(pipe.recv(), lambda: os.getppid() != parent))


def _leave(number: int, frame: FrameType | None) -> None:
    sys.exit(128 + number)  # an exception, so that unfinished folders are removed
