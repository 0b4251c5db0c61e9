"""The number of particles that a belief needs: KLD sampling (Fox 2003)."""

from __future__ import annotations

import numpy as np


def particles_needed(bins: int, error: float, quantile: float) -> int:
    """Number of samples that keeps the Kullback-Leibler distance to a belief over `bins` bins below `error`.

    `quantile` is that of the standard normal distribution for the wanted probability (2.33 for 0.99). Source: Fox 2003, with the
    chi-square quantile by the approximation of Wilson and Hilferty.
    """
    if bins <= 1:
        return 1
    k = bins - 1
    a = 2.0 / (9.0 * k)
    return int(np.ceil(k / (2.0 * error) * (1.0 - a + np.sqrt(a) * quantile) ** 3))
