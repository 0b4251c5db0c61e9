"""How fast this machine is just now: bounds in seconds are for a machine of REFERENCE_S, and are scaled to this one."""

from __future__ import annotations

import re
import time

import numpy as np

# Time of `yardstick_s` on the cloud machine of two cores that the bounds were set on: undisturbed it was 0.07 to 0.10.
REFERENCE_S = 0.10
REPEATS = 3
PER_SECOND = re.compile(r"(million)?1?/s")
SECONDS = re.compile(r"m?s( .*)?")


def slowness() -> float:
    """Time of the yardstick over that of the reference: 2 on a machine of half its speed, 1 on any that is as fast or faster."""
    return max(min(yardstick_s() for _ in range(REPEATS)) / REFERENCE_S, 1.0)


def yardstick_s() -> float:
    """Seconds for work like the program's: a loop in Python, sorting, and sums over more memory than the caches hold."""
    values = np.random.default_rng(0).random(1_000_000)
    large = np.ones(8_000_000)
    started = time.perf_counter()
    total = 0
    for k in range(1_000_000):
        total += k & 7
    np.sort(values)
    large += large
    large.sum()
    return time.perf_counter() - started


def bound_here(bound: float, unit: str, slower: float) -> float:
    """The bound on a machine that is slower by the factor: only times and rates are other ones there."""
    if SECONDS.fullmatch(unit):
        return bound * slower
    return bound / slower if PER_SECOND.fullmatch(unit) else bound
