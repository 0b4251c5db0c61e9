"""The command line: the only package that prints and turns errors into exit codes."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress

INTERRUPTED = 130


def run() -> None:
    """The entry point of the program. Ctrl-C and SIGTERM give one line from the start on."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        from .main import main

        code = main(sys.argv[1:])
        _ignore_signals()
    except KeyboardInterrupt:  # during import or exit
        _ignore_signals()
        with suppress(OSError):
            os.write(2, b"gridslam: error: interrupted\n")
        code = INTERRUPTED
    sys.exit(code)


def _ignore_signals() -> None:
    """The work is done and the exit code is known: a signal that comes now changes neither."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
