"""Kernels beside their slow twins: what the benchmarks bench_kernels*.py have in common.

Twins stand in tests/reference, where tests hold them and the kernels together; here both are timed on the same input, warm, in
one process. Bounds are about a third of what was measured on two cores that had other work: a kernel that is no longer compiled
breaks them, a busy machine does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.bench_localize import best_ms
from tests.benchmarks.harness import Row

Floats = NDArray[np.float64]
Call = Callable[[], object]
Pair = tuple[Call, Call]  # the kernel, the twin


def rows_of_pairs(pairs: Iterable[tuple[str, float, Pair]]) -> Iterator[Row]:
    """Of each name, least factor, and pair: milliseconds of a call for information, the factor with its bound."""
    for name, at_least, (kernel, twin) in pairs:
        ours = best_ms(kernel)
        yield Row(f"kernels.{name}", ours, "ms")
        yield Row(f"kernels.{name}.over_twin", best_ms(twin, 2) / ours, "x", at_least, at_least=True)
