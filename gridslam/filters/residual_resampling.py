"""Residual resampling (slam-sd; Liu and Chen 1998)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def residual_ancestors(weights: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.int64]:
    """Ancestors `(n,)` of n particles with normalised weights `(n,)`; a particle that survives keeps its index.

    Each particle gets floor(n w) copies; the remaining ones are drawn with probabilities proportional to the remainders.
    """
    n = len(weights)
    counts = np.floor(n * weights).astype(np.int64)
    remaining = n - int(counts.sum())
    if remaining:
        remainder = n * weights - counts
        drawn = rng.choice(n, size=remaining, p=remainder / remainder.sum())
        counts += np.bincount(drawn, minlength=n)
    ancestors = np.where(counts > 0, np.arange(n), -1)
    ancestors[ancestors < 0] = np.repeat(np.arange(n), np.maximum(counts - 1, 0))
    return ancestors
