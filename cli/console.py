"""What people and scripts see: the result on stdout, everything else on stderr."""

from __future__ import annotations

import codecs
import io
import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gridslam.runs.run import Progress

SHOW_EVERY_S = 0.1


@dataclass(slots=True)
class ConsoleOptions:
    """What the options --quiet and --debug, common to all commands, have chosen; whether stderr was written to."""

    quiet: bool = False
    debug: bool = False
    has_spoken: bool = False


settings = ConsoleOptions()


def start() -> None:
    """Send the library's warnings to stderr, one line each; let no character stop the output. Called once."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    handler = _StderrHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    logger = logging.getLogger("gridslam")
    logger.handlers[:] = [handler]
    logger.propagate = False


class _StderrHandler(logging.Handler):
    """Looks sys.stderr up for each line, since tests and shells replace it."""

    def emit(self, record: logging.LogRecord) -> None:
        label = "" if record.levelno < logging.WARNING else "warning: "
        say(f"{label}{self.format(record)}")


def say(line: str) -> None:
    """A line for the person who waits; not with --quiet."""
    if not settings.quiet:
        complain(line)


def complain(line: str) -> None:
    """A line on stderr, also with --quiet."""
    settings.has_spoken = True
    if sys.stderr is None:
        return
    try:
        sys.stderr.write(f"gridslam: {line}\n")
        sys.stderr.flush()
    except OSError:  # nobody reads it, or its disk is full: the exit code says the rest
        sys.stderr = None


def emit(text: str) -> None:
    """Text of the result on stdout. A reader that went away (`| head`) ends the output, not the command."""
    if sys.stdout is None:
        return
    try:
        sys.stdout.write(text if text.endswith("\n") else text + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        silence_stdout()


def silence_stdout() -> None:
    """Let all further output, also what Python flushes at exit, go nowhere."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)


def emit_json(document: Mapping[str, Any] | Sequence[Any]) -> None:
    """The result as one JSON document. What stdout cannot take as UTF-8 is written as JSON's own escapes."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    if not _is_utf8(text):
        text = json.dumps(document, indent=2, allow_nan=False)
    emit(text)


def _is_utf8(text: str) -> bool:
    """Whether the text would leave as valid UTF-8: a file's name need not be text."""
    if codecs.lookup(getattr(sys.stdout, "encoding", None) or "utf-8").name != "utf-8":
        return False
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def emit_table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """The result as aligned columns; numbers to the right. No columns' names: rows alone."""
    texts = [[str(cell) for cell in row] for row in rows]
    lines = [list(columns), *texts] if any(columns) else texts
    if not lines:
        return
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    right = [bool(rows) and all(isinstance(row[i], (int, float)) for row in rows) for i in range(len(widths))]
    emit("\n".join(_aligned(line, widths, right) for line in lines))


def _aligned(line: Sequence[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    cells = [cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(line, widths, right, strict=True)]
    return "  ".join(cells).rstrip()


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[Progress], None]]:
    """A function that shows how far a run is; it shows nothing unless stderr is a terminal."""
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
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None, rate="")
        started, shown = None, 0.0

        def show(progress: Progress) -> None:
            nonlocal started, shown
            now = time.monotonic()
            started = now if started is None else started
            if progress.is_finishing:
                bar.update(task, description=f"{what}, final stage", total=None, rate="")
                return
            if now - shown < SHOW_EVERY_S:
                return
            shown = now
            rate = f"{progress.scans / max(now - started, 1e-3):.0f} scans/s" if progress.scans else ""
            bar.update(task, completed=progress.events, total=progress.max_events, rate=rate)

        yield show
