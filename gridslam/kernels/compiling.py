"""Reports that kernels are being compiled, and for how long: once per installation, as numba keeps them in its cache."""

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
    """Within the block `report` is called once, when a kernel is compiled that numba's cache does not hold."""
    with event.install_listener("numba:compile", _FirstStart(report)):
        yield


class CompilationClock(event.Listener):
    """How long kernels have been compiled for, in `seconds`; those that another one calls are part of it."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0
        self._started = 0.0

    def now(self) -> float:
        """A clock (s) that stands still while kernels are compiled."""
        return time.perf_counter() - self.seconds

    def on_start(self, event: event.Event) -> None:
        if not self._depth:
            self._started = time.perf_counter()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._started


@contextmanager
def timing_compilation() -> Iterator[CompilationClock]:
    """A clock that runs while kernels are compiled within the block."""
    clock = CompilationClock()
    with event.install_listener("numba:compile", clock):
        yield clock
