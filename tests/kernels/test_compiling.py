from __future__ import annotations

from numba import njit

from gridslam.kernels.compiling import telling_of_compilation


def test_compilation_is_told_once_and_only_when_it_happens() -> None:
    @njit
    def one(x: float) -> float:
        return x + 1.0

    @njit
    def two(x: float) -> float:
        return x + 2.0

    told: list[str] = []
    with telling_of_compilation(lambda: told.append("compiling")):
        assert one(1.0) == 2.0
        assert two(1.0) == 3.0
    assert told == ["compiling"]
    with telling_of_compilation(lambda: told.append("again")):
        assert one(2.0) == 3.0
    assert told == ["compiling"]
