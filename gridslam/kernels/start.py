"""Preparation of numba, once in a process."""

from __future__ import annotations

from gridslam.kernels.compiled import compiled


def start() -> None:
    """Let numba set itself up, which takes a fifth of a second, before a log is read and its processing is timed."""
    _same(0.0)


@compiled
def _same(value: float) -> float:
    return value
