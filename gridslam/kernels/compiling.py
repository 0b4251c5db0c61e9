"""Reports that kernels are being compiled, and measures the time; compiled kernels are kept by `machine_code_cache`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event


class _FirstStart(event.Listener):
    """Calls `report` when the first kernel is compiled."""

    def __init__(self, report: Callable[[], None]) -> None:
        self.report = report
        self.has_reported = False

    def on_start(self, event: event.Event) -> None:
        if not self.has_reported:
            self.has_reported = True
            self.report()

    def on_end(self, event: event.Event) -> None:
        pass


@contextmanager
def announcing_compilation(report: Callable[[], None]) -> Iterator[None]:
    """Within the block, call `report` when the first kernel is compiled; kernels loaded from the cache do not count."""
    with event.install_listener("numba:compile", _FirstStart(report)):
        yield


class CompilationClock(event.Listener):
    """Measures compilation: `seconds` is the total so far; a kernel compiled while compiling its caller counts once."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._started = 0.0

    def now(self) -> float:
        """Time (s) of a clock that leaves out compilation; only differences have a meaning."""
        return time.perf_counter() - self.seconds

    def on_start(self, event: event.Event) -> None:
        """Called by numba before a kernel is compiled."""
        if not self._depth:
            self._started = time.perf_counter()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        """Called by numba after a kernel was compiled."""
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._started


@contextmanager
def timing_compilation() -> Iterator[CompilationClock]:
    """Measures the time that compilation takes within the block."""
    clock = CompilationClock()
    with event.install_listener("numba:compile", clock):
        yield clock
