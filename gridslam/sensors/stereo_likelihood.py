"""Likelihood of a stereo measurement for every position of the first obstacle on its ray.

The likelihoods P(o | E) of stereo-bayes, eq. 2, are sums of these (paper sections 2.1 to 2.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Floats = NDArray[np.float64]

MIN_DEPTH_M, MIN_WIDTH_PX = 1e-6, 1e-9  # avoid divisions by zero


@dataclass(frozen=True, slots=True)
class StereoNoise:
    """Standard deviation of a disparity (px), probabilities of a missed and a false match, and range of disparities (px)."""

    sigma_px: float
    p_none: float
    p_false: float
    range_px: float


def first_likelihoods(
    disparities_px: Floats, focal_baseline: float, edges_m: Floats, noise: StereoNoise
) -> tuple[Floats, Floats]:
    """P(o | first = k) `(m, n)` and P(o | no obstacle on the ray) `(m,)`.

    `disparities_px` `(m,)` is NaN without a match; `focal_baseline` in px m; `edges_m` `(m, n + 1)` are the depths (m)
    between the cells. The normal density of the disparity is averaged over each cell, because near cells are
    wider than the density.
    """
    matched = np.isfinite(disparities_px)
    d = np.where(matched, disparities_px, 0.0)[:, None]
    at_edges = focal_baseline / np.maximum(edges_m, MIN_DEPTH_M)
    cumulative = ndtr((at_edges - d) / noise.sigma_px)
    width = np.maximum(at_edges[:, :-1] - at_edges[:, 1:], MIN_WIDTH_PX)
    density = (cumulative[:, :-1] - cumulative[:, 1:]) / width
    false = noise.p_false / noise.range_px
    first = (1.0 - noise.p_none - noise.p_false) * density + false
    # A match beyond the last cell is neither a false match nor an obstacle on the ray.
    beyond = 1.0 - ndtr((d[:, 0] - at_edges[:, -1]) / noise.sigma_px)
    none = false + (1.0 - noise.p_none - noise.p_false) * beyond / np.maximum(at_edges[:, -1], MIN_WIDTH_PX)
    first = np.where(matched[:, None], first, noise.p_none)
    return first, np.where(matched, none, 1.0 - noise.p_false)
