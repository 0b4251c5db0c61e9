"""The errors that gridslam raises on purpose, with their exit codes.

    GridslamError
    +-- ConfigError    2   a config file, an override or an argument is wrong
    +-- InputError     3   an input cannot be read
    |   +-- LogError       ... a log
    |   +-- MapError       ... a map
    +-- MethodError    4   a method cannot continue
    +-- GateError      1   a --require gate failed

Any other exception that reaches the user is a bug (exit code 70). A message says what is wrong, where (file, line or message
index, key path) and what to do about it.
"""

from __future__ import annotations

import struct
import zlib

from gridslam.core.texts import shortened

# What decoders raise for damaged pictures; MemoryError since a damaged header can state any size.
PICTURE_DAMAGE = (
    OSError,
    ValueError,
    SyntaxError,
    EOFError,
    IndexError,
    MemoryError,
    struct.error,
    zlib.error,
)


class GridslamError(Exception):
    """Base of all errors raised on purpose; `str(error)` is the one line that the user sees."""

    exit_code = 70

    def __str__(self) -> str:
        """The message; its middle is cut out if names from a file make it longer than a screen."""
        return shortened(super().__str__())


def message_of(error: BaseException) -> str:
    """The message of an error; empty if `str(error)` fails, as it can for classes of other packages."""
    try:
        return str(error)
    except Exception:
        return ""


def was_interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused an error, directly or as the cause of the error that interrupted compiled code raises."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


class ConfigError(GridslamError):
    """A config file, an override or an argument is wrong; the message names the key path."""

    exit_code = 2


class InputError(GridslamError):
    """An input file cannot be read; the message names the file and the place in it."""

    exit_code = 3


class LogError(InputError):
    """A log cannot be read, or lacks what the method needs."""


class MapError(InputError):
    """A map cannot be read."""


class MethodError(GridslamError):
    """A method cannot continue with its input."""

    exit_code = 4


class GateError(GridslamError):
    """A measure did not meet the bound that `--require` sets."""

    exit_code = 1
