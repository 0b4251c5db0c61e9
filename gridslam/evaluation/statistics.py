"""Statistics of errors, as in evo."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Statistics: TypeAlias = dict[str, float]

NAMES = ("rmse", "mean", "median", "std", "min", "max")


def statistics(errors: NDArray[np.float64]) -> Statistics:
    """rmse, mean, median, std (population), min and max of errors `(n,)`; NaN if n = 0."""
    if not len(errors):
        return dict.fromkeys(NAMES, float("nan"))
    values = (
        np.sqrt(np.mean(errors**2)),
        np.mean(errors),
        np.median(errors),
        np.std(errors),
        np.min(errors),
        np.max(errors),
    )
    return {name: float(value) for name, value in zip(NAMES, values, strict=True)}
