"""Processes that this one starts and ends itself."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

FROM_TERMINAL = frozenset((signal.SIGINT, signal.SIGHUP))


@contextmanager
def shielded_from_terminal() -> Iterator[None]:
    """Processes started in the block never get Ctrl-C, nor the end of their terminal, which reach all processes of it.

    Only this process, which ends the others, handles them; one that comes within the block waits until its end.
    """
    resource_tracker.ensure_running()  # or its start, which unblocks signals, would be that of the first process
    before = signal.pthread_sigmask(signal.SIG_BLOCK, FROM_TERMINAL)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
