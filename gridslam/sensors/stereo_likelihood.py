"""How likely a stereo measurement is for every place of the first obstacle on its ray.

The inverse sensor model of stereo-bayes: what the P(o | E) of eq. 2 are summed up from (paper sections 2.1 to 2.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class StereoNoise:
    """Standard deviation of a disparity, shares of missed and of false matches, and the range of disparities."""

    sigma_px: float
    p_none: float
    p_false: float
    range_px: float


def first_likelihoods(
    disparities_px: Floats, focal_baseline: float, edges_m: Floats, noise: StereoNoise
) -> tuple[Floats, Floats]:
    """P(o | first = k) `(m, n)` and P(o | no obstacle on the ray) `(m,)`.

    `disparities_px` `(m,)`: NaN is "no match"; `edges_m` `(m, n + 1)` are the depths between the cells. The normal density of the
    disparity is averaged over a cell, since near cells are wider than it.
    """
    matched = np.isfinite(disparities_px)
    d = np.where(matched, disparities_px, 0.0)[:, None]
    at_edges = focal_baseline / np.maximum(edges_m, 1e-6)
    cumulative = ndtr((at_edges - d) / noise.sigma_px)
    width = np.maximum(at_edges[:, :-1] - at_edges[:, 1:], 1e-9)
    density = (cumulative[:, :-1] - cumulative[:, 1:]) / width
    false = noise.p_false / noise.range_px
    first = (1.0 - noise.p_none - noise.p_false) * density + false
    # A match of something beyond the last cell is no false one, and no obstacle of the ray either.
    beyond = 1.0 - ndtr((d[:, 0] - at_edges[:, -1]) / noise.sigma_px)
    none = false + (1.0 - noise.p_none - noise.p_false) * beyond / np.maximum(at_edges[:, -1], 1e-9)
    first = np.where(matched[:, None], first, noise.p_none)
    return first, np.where(matched, none, 1.0 - noise.p_false)
