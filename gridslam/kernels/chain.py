"""What one measurement along a ray says about its cells, when the first obstacle hides the rest (stereo-bayes 2.1 - 2.3)."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel


@compiled
def bounded_covariance(p: float, p_next: float, correlation: float) -> float:
    """r alpha of two neighbours, alpha = sqrt(p q p' q'), such that their joint distribution exists (Frechet limits)."""
    covariance = correlation * np.sqrt(p * (1.0 - p) * p_next * (1.0 - p_next))
    low = max(0.0, p + p_next - 1.0) - p * p_next
    high = min(p, p_next) - p * p_next
    return float(min(max(covariance, low), high))


@compiled
def hidden_chain(
    prior: NDArray[np.float64],
    correlation: NDArray[np.float64],
    first: NDArray[np.float64],
    none: float,
    occupied: NDArray[np.float64],
    empty: NDArray[np.float64],
    reached: NDArray[np.float64],
) -> float:
    """Exact likelihoods of a Markov chain of cells of which the first occupied one is measured (eqs. 5 - 8).

    `prior` `(n,)` are P(E_k), strictly between 0 and 1; `correlation` `(n,)` that of each cell with the one before it (the first
    is not used); `first` `(n,)` is P(o | first = k), `none` is P(o | no obstacle). Writes P(o | E_k) into `occupied` and
    P(o | not E_k) into `empty`, and P(o, nothing before k is occupied) into `reached`; returns P(o). One pass outwards and one
    back, O(n).
    """
    n = prior.shape[0]
    hit = np.empty(n)  # P(o, first = k)
    clear, h1, h0 = 1.0, 0.0, 0.0
    for k in range(n):
        p = prior[k]
        from_occupied, from_empty = p, p
        if k > 0:
            before = prior[k - 1]
            covariance = bounded_covariance(before, p, correlation[k])
            from_occupied = p + covariance / before
            from_empty = p - covariance / (1.0 - before)
        hit[k] = first[k] * clear * from_empty
        h1, h0 = (
            h1 * from_occupied + h0 * from_empty + hit[k],
            h1 * (1.0 - from_occupied) + h0 * (1.0 - from_empty),
        )
        clear *= 1.0 - from_empty
        occupied[k], empty[k] = h1, h0
    later = none * clear  # P(o, first hit behind k or none)
    for k in range(n - 1, -1, -1):
        occupied[k] /= prior[k]
        empty[k] = (empty[k] + later) / (1.0 - prior[k])
        later += hit[k]
        reached[k] = later
    return float(later)


@compiled
def front_is_empty(
    prior: NDArray[np.float64],
    first: NDArray[np.float64],
    none: float,
    occupied: NDArray[np.float64],
    empty: NDArray[np.float64],
    reached: NDArray[np.float64],
) -> float:
    """The conventional likelihoods: all cells before the one that explains the measurement are taken to be empty.

    So cell k explains it with a weight of P(E_k) alone, and none does with that of all being empty: P(o | E_k) is
    P(o | first = k), P(o | not E_k) the weighted mean over the cells behind k. Arguments and result as of `hidden_chain`.
    """
    clear, weight, mass = (
        1.0,
        0.0,
        0.0,
    )  # of the cells behind: all empty, sum of P(E), sum of P(E) P(o | first)
    for k in range(prior.shape[0] - 1, -1, -1):
        occupied[k], empty[k] = first[k], (mass + clear * none) / (weight + clear)
        clear *= 1.0 - prior[k]
        weight += prior[k]
        mass += prior[k] * first[k]
        reached[k] = mass + clear * none
    for k in range(prior.shape[0]):
        reached[k] /= weight + clear
    return float((mass + clear * none) / (weight + clear))


@compiled_parallel
def likelihoods_of_rays(
    priors: NDArray[np.float64],
    correlations: NDArray[np.float64],
    firsts: NDArray[np.float64],
    nones: NDArray[np.float64],
    assume_front_empty: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """P(o | E_k) / P(o), P(o | not E_k) / P(o) and P(nothing before k is occupied | o) `(m, n)` for m rays of n cells.

    See `hidden_chain`. The three likelihoods of the paper: front taken as empty (independent), correlations of 0 (occlusion),
    or others (chain).
    """
    m, n = priors.shape
    occupied, empty, reached = np.empty((m, n)), np.empty((m, n)), np.empty((m, n))
    for i in prange(m):
        if assume_front_empty:
            total = front_is_empty(priors[i], firsts[i], nones[i], occupied[i], empty[i], reached[i])
        else:
            total = hidden_chain(
                priors[i], correlations[i], firsts[i], nones[i], occupied[i], empty[i], reached[i]
            )
        occupied[i] /= total
        empty[i] /= total
        reached[i] /= total
    return occupied, empty, reached


@compiled_parallel
def expected_behind(
    reached: NDArray[np.float64], correlations: NDArray[np.float64], prior: float
) -> NDArray[np.float64]:
    """P(E_k | o) `(m, n)` for a ray behind whose first obstacle nothing but the chain with the one `prior` is known.

    `reached` `(m, n)` is P(nothing before k is occupied | o) and `correlations` `(m, n)` those of each cell with the one
    before it, as of `likelihoods_of_rays`. What lies before the first obstacle is empty.
    """
    m, n = reached.shape
    expected = np.empty((m, n))
    for i in prange(m):
        occupied, hidden = 0.0, 0.0  # P(first < k, E_k), P(first < k)
        for k in range(n):
            r = correlations[i, k]
            occupied = occupied * (prior + r * (1.0 - prior)) + (hidden - occupied) * prior * (1.0 - r)
            first = reached[i, k] - reached[i, k + 1] if k + 1 < n else 0.0
            occupied += first
            hidden += first
            expected[i, k] = occupied
    return expected
