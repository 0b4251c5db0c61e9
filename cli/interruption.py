"""Signals as a request to stop, for commands that stop at a safe point; and where they come too late."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from . import console, heeded_signals, is_repetition


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
        if is_repetition():
            return
        if requested or not is_asked:
            raise KeyboardInterrupt
        requested = True
        console.say(notice)

    def ask() -> bool:
        nonlocal is_asked
        is_asked = True
        return requested

    with _handled_by(request):
        yield ask


@contextmanager
def finishing() -> Iterator[None]:
    """Signals come too late within the block: the result is there, and is written and shown whole."""
    with _handled_by(signal.SIG_IGN):
        yield


@contextmanager
def _handled_by(handler: Any) -> Iterator[None]:
    """The signals that are heeded have this handler within the block."""
    before = {number: signal.signal(number, handler) for number in heeded_signals()}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)
