from __future__ import annotations

import time

from numba import njit

from gridslam.kernels.compiling import announcing_compilation, timing_compilation


def test_compilation_is_reported_once_and_only_when_it_happens() -> None:
    @njit
    def one(x: float) -> float:
        return x + 1.0

    @njit
    def two(x: float) -> float:
        return x + 2.0

    reports: list[str] = []
    with announcing_compilation(lambda: reports.append("compiling")):
        assert one(1.0) == 2.0
        assert two(1.0) == 3.0
    assert reports == ["compiling"]
    with announcing_compilation(lambda: reports.append("again")):
        assert one(2.0) == 3.0
    assert reports == ["compiling"]


def test_the_clock_stands_still_while_kernels_are_compiled() -> None:
    @njit
    def inner(x: float) -> float:
        return x + 1.0

    @njit
    def outer(x: float) -> float:
        return inner(x)  # compiled within the outer one: counted once

    started = time.perf_counter()
    with timing_compilation() as clock:
        began = clock.now()
        assert outer(1.0) == 2.0
        took = clock.now() - began
        compiled_s = clock.seconds
        assert outer(2.0) == 3.0
        assert clock.seconds == compiled_s
    whole = time.perf_counter() - started
    assert 0.0 < compiled_s < whole
    assert took + compiled_s <= whole
    assert took < compiled_s
