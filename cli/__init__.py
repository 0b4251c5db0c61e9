"""The command line: the only package that prints and turns errors into exit codes."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import time
from contextlib import suppress
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # Ctrl-C, a request to end, a closed terminal
AT_ONCE_S = 0.5  # signals so close together are one: `timeout` and others send theirs twice

_obeyed_s = -AT_ONCE_S  # when the last signal that was no repetition came


def run() -> None:
    """The entry point of the program. Signals give one line from the start on."""
    _occupy_closed_streams()
    for number in heeded_signals():
        signal.signal(number, interrupt)
    try:
        from .main import main

        code = main(sys.argv[1:])
        _ignore_signals()
    except KeyboardInterrupt:  # during import or exit
        _ignore_signals()
        with suppress(OSError):
            os.write(2, b"gridslam: error: interrupted\n")
        code = INTERRUPTED
    _leave(code)


def _leave(code: int) -> NoReturn:
    """End the process, after the functions that were registered for its end, without taking its modules and arrays apart.

    That takes a third of a second, as long as many a command, and frees nothing that the system does not free as well.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # on a full disk, closed, or never there
            stream.flush()
    os._exit(code)


def _occupy_closed_streams() -> None:
    """Open the null device for each closed standard stream: the next file would get its number, and what is written to it."""
    for number in (0, 1, 2):
        if not _is_open(number):
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def interrupt(number: int, frame: FrameType | None) -> None:
    """The handler of signals outside of what stops at a safe point: raises KeyboardInterrupt."""
    if not is_repetition():
        raise KeyboardInterrupt


def is_repetition() -> bool:
    """Whether the signal that has just come belongs to the one before.

    What that one has begun is not disturbed: removing unfinished files above all.
    """
    global _obeyed_s
    now_s = time.monotonic()
    if now_s - _obeyed_s < AT_ONCE_S:
        return True
    _obeyed_s = now_s
    return False


def heeded_signals() -> list[signal.Signals]:
    """The signals that end a command, without those that its parent ignores: SIGHUP under `nohup`, SIGINT in the background."""
    return [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]


def _ignore_signals() -> None:
    """The work is done and the exit code is known: a signal that comes now changes neither."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
