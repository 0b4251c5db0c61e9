"""Timing of kernels against their reference implementations, for the benchmarks bench_kernels*.py.

The reference implementations are in tests/reference, and tests compare their results; here both are timed on the same input,
warm, in one process. Bounds are at most half of the smallest factor measured, on idle and on busy cores: a kernel that is no
longer compiled breaks them, the machine does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.bench_localize import best_ms
from tests.benchmarks.harness import BenchmarkRow

Floats = NDArray[np.float64]
Call = Callable[[], object]
Pair = tuple[Call, Call]  # the kernel, the reference

TIMES = 30


def rows_of_pairs(pairs: Iterable[tuple[str, float, Pair]]) -> Iterator[BenchmarkRow]:
    """Rows of each (name, smallest factor, pair): milliseconds of a call for information, and the factor with its bound."""
    for name, min_factor, (kernel, reference) in pairs:
        before, slow, after = best_ms(kernel, TIMES), best_ms(reference, 2), best_ms(kernel, TIMES)
        ours = min(before, after)  # other load may affect one of the two
        yield BenchmarkRow(f"kernels.{name}", ours, "ms")
        yield BenchmarkRow(f"kernels.{name}.over_reference", slow / ours, "x", min_factor, at_least=True)
