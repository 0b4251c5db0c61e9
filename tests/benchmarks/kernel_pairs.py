"""Kernels beside their slow reference implementations: what the benchmarks bench_kernels*.py have in common.

Twins stand in tests/reference, where tests hold them and the kernels together; here both are timed on the same input, warm, in
one process. Bounds are about a third of the least that was measured on two busy cores: a kernel that is no longer compiled
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
Pair = tuple[Call, Call]  # the kernel, the reference

TIMES = 30


def rows_of_pairs(pairs: Iterable[tuple[str, float, Pair]]) -> Iterator[Row]:
    """Of each name, least factor, and pair: milliseconds of a call for information, the factor with its bound."""
    for name, at_least, (kernel, reference) in pairs:
        before, slow, after = best_ms(kernel, TIMES), best_ms(reference, 2), best_ms(kernel, TIMES)
        ours = min(before, after)  # one of them alone may fall into a moment in which others had the cores
        yield Row(f"kernels.{name}", ours, "ms")
        yield Row(f"kernels.{name}.over_reference", slow / ours, "x", at_least, at_least=True)
