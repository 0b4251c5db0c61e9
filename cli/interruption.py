"""Ctrl-C and SIGTERM as a wish to stop, for commands that end at a place of their own choice."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from . import console


@contextmanager
def stop_on_signals(
    answer: str = "stopping; what is known so far is written (a second signal drops it)",
) -> Iterator[Callable[[], bool]]:
    """A function that tells whether to stop. A second signal ends the command at once, without a result."""
    asked = False

    def ask(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True
        console.say(answer)

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
