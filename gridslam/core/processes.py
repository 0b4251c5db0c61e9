"""Child processes that only this process ends."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

FROM_TERMINAL = frozenset((signal.SIGINT, signal.SIGHUP))


@contextmanager
def shielded_from_terminal() -> Iterator[None]:
    """Processes started in the block ignore Ctrl-C and the end of the terminal, which are sent to all processes of a terminal.

    Only this process handles these signals, and ends the others. A signal that arrives within the block is handled after it.
    """
    resource_tracker.ensure_running()  # or its start, which unblocks signals, would be that of the first process
    before = signal.pthread_sigmask(signal.SIG_BLOCK, FROM_TERMINAL)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
