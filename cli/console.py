"""Output of commands: the result on stdout, everything else on stderr."""

from __future__ import annotations

import codecs
import errno
import io
import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TextIO, cast

from gridslam.core.texts import shortened

if TYPE_CHECKING:
    from gridslam.runs.feed import Progress

UPDATE_EVERY_S = 0.1


@dataclass(slots=True)
class ConsoleOptions:
    """The common options --quiet and --debug, and whether anything was written to stderr."""

    quiet: bool = False
    debug: bool = False
    has_spoken: bool = False


settings = ConsoleOptions()


def start() -> None:
    """Send the library's log messages to stderr, one line each; escape characters that stdout cannot encode.

    What other libraries log, such as remarks about damaged pictures, is not shown.
    """
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    handler = _StderrHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    if not logging.root.handlers:  # or Python writes it to stderr
        logging.root.addHandler(logging.NullHandler())
    logger = logging.getLogger("gridslam")
    logger.handlers[:] = [handler]
    logger.propagate = False


class _StderrHandler(logging.Handler):
    """Writes to the present sys.stderr, which tests and shells replace."""

    def emit(self, record: logging.LogRecord) -> None:
        label = "" if record.levelno < logging.WARNING else "warning: "
        say(f"{label}{self.format(record)}")


def say(line: str) -> None:
    """Print a line to stderr, unless --quiet."""
    if not settings.quiet:
        complain(line)


def complain(line: str) -> None:
    """Print a line to stderr, also with --quiet."""
    settings.has_spoken = True
    if sys.stderr is None:
        return
    try:
        sys.stderr.write(f"gridslam: {shortened(escaped(line))}\n")
        sys.stderr.flush()
    except OSError:  # closed, or on a full disk: only the exit code remains
        sys.stderr = None


def escaped(text: str) -> str:
    """The text with control and other invisible characters, which may come from a file, as Python's escapes."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def emit(text: str) -> None:
    """Print text of the result to stdout. A closed pipe (`| head`) or terminal ends the output, not the command."""
    if sys.stdout is None:
        return
    try:
        sys.stdout.write(text if text.endswith("\n") else text + "\n")
        sys.stdout.flush()
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EIO):
            raise
        silence_stdout()


def silence_stdout() -> None:
    """Discard all further output, including what Python flushes at exit."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)


def emit_json(document: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print the result as one JSON document. JSON escapes are used for what stdout or a terminal cannot take."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    if not _is_utf8(text) or not text.replace("\n", "").isprintable():
        text = json.dumps(document, indent=2, allow_nan=False)
    emit(text)


def _is_utf8(text: str) -> bool:
    """Whether the text can be encoded as UTF-8; file names may have bytes that are not text."""
    if codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name != "utf-8":
        return False
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def emit_table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print the result as aligned columns, numbers right-aligned. Empty column names: no header."""
    texts = [[escaped(str(cell)) for cell in row] for row in rows]
    lines = [list(columns), *texts] if any(columns) else texts
    if not lines:
        return
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    right = [bool(rows) and all(isinstance(row[i], (int, float)) for row in rows) for i in range(len(widths))]
    emit("\n".join(_aligned(line, widths, right) for line in lines))


def _aligned(line: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    cells = [cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(line, widths, right, strict=True)]
    return "  ".join(cells).rstrip()


class _Terminal(io.TextIOBase):
    """stderr for a progress bar, which ends with the terminal, and the command does not."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """That of the terminal, which decides on the characters of the bar."""
        return self._stream.encoding

    def isatty(self) -> bool:
        """Always."""
        return True

    def fileno(self) -> int:
        """Number of the open file, by which the width of the terminal is asked for."""
        return self._stream.fileno()

    def write(self, text: str) -> int:
        """Write text, as long as the terminal is there."""
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Show what was written, as long as the terminal is there."""
        with suppress(OSError):
            self._stream.flush()


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[Progress], None]]:
    """A function that shows the progress of a run if stderr is a terminal."""
    if settings.quiet or sys.stderr is None or not sys.stderr.isatty():
        yield lambda progress: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %  {task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(file=cast("TextIO", _Terminal(sys.stderr))), transient=True) as bar:
        task = bar.add_task(what, total=None, rate="")
        started, shown = None, 0.0

        def show(progress: Progress) -> None:
            nonlocal started, shown
            now = time.monotonic()
            started = now if started is None else started
            if progress.is_finishing:
                bar.update(task, description=f"{what}, computing the result", total=None, rate="")
                return
            if now - shown < UPDATE_EVERY_S:
                return
            shown = now
            rate = f"{progress.scans / max(now - started, 1e-3):.0f} scans/s" if progress.scans else ""
            bar.update(task, completed=progress.events, total=progress.max_events, rate=rate)

        yield show
