"""Ctrl-C and SIGTERM as a request to stop, for commands that stop at a safe point; and where they come too late."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from . import console


@contextmanager
def stop_on_signals(
    notice: str = "stopping; the result so far is written (a second signal discards it)",
) -> Iterator[Callable[[], bool]]:
    """A function that returns whether to stop.

    A second signal ends the command at once, without a result, and so does the first one where nobody has asked yet: nothing
    is there that could be written.
    """
    requested = is_asked = False

    def request(number: int, frame: FrameType | None) -> None:
        nonlocal requested
        if requested or not is_asked:
            raise KeyboardInterrupt
        requested = True
        console.say(notice)

    def ask() -> bool:
        nonlocal is_asked
        is_asked = True
        return requested

    before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield ask
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def finishing() -> Iterator[None]:
    """Signals come too late within the block: the result is there, and is written and shown whole."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
