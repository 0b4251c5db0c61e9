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
    except KeyboardInterrupt:  # during import or exit
        with suppress(OSError):
            os.write(2, b"gridslam: error: interrupted\n")
        code = INTERRUPTED
    sys.exit(code)
