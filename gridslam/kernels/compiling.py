"""Tells that kernels are being compiled: once per installation, afterwards they come from numba's cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event


class _FirstStart(event.Listener):
    """Calls `tell` when the first kernel is compiled."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self.tell = tell
        self.told = False

    def on_start(self, event: event.Event) -> None:
        if not self.told:
            self.told = True
            self.tell()

    def on_end(self, event: event.Event) -> None:
        pass


@contextmanager
def telling_of_compilation(tell: Callable[[], None]) -> Iterator[None]:
    """Within the block `tell` is called once, when a kernel is compiled that numba's cache does not hold."""
    with event.install_listener("numba:compile", _FirstStart(tell)):
        yield
