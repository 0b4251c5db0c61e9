"""Likelihoods of the cells along a ray whose first obstacle hides the cells behind it (stereo-bayes, sections 2.1 to 2.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import run_in_ranges

Floats = NDArray[np.float64]


class CellPriors(NamedTuple):
    """P(E_k) of the cells, strictly between 0 and 1, and the correlation of each cell with the one before it.

    The first correlation is not used. `(n,)` for one ray, `(m, n)` for m rays.
    """

    occupied: Floats
    correlation: Floats


class RayEvidence(NamedTuple):
    """The evidence of a measurement o for every cell: P(o | E_k), P(o | not E_k), and P(o, nothing before k is occupied).

    `(n,)` for one ray. For m rays `(m, n)`, all divided by P(o).
    """

    occupied: Floats
    empty: Floats
    reached: Floats


@compiled
def bounded_covariance(p: float, p_next: float, correlation: float) -> float:
    """r alpha of two neighbours, alpha = sqrt(p q p' q'), bounded so that their joint distribution exists (Frechet limits)."""
    covariance = correlation * np.sqrt(p * (1.0 - p) * p_next * (1.0 - p_next))
    low = max(0.0, p + p_next - 1.0) - p * p_next
    high = min(p, p_next) - p * p_next
    return float(min(max(covariance, low), high))


@compiled
def hidden_chain(priors: CellPriors, first: Floats, none: float, evidence: RayEvidence) -> float:
    """P(o) for a Markov chain of cells whose first occupied one is measured; exact (eqs. 5 - 8).

    `first` `(n,)` is P(o | first = k), `none` is P(o | no obstacle). Fills `evidence`. One pass outwards and one back, O(n).
    """
    prior, correlation = priors.occupied, priors.correlation
    occupied, empty, reached = evidence.occupied, evidence.empty, evidence.reached
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
    later = none * clear  # P(o, the first obstacle is behind k or absent)
    for k in range(n - 1, -1, -1):
        occupied[k] /= prior[k]
        empty[k] = (empty[k] + later) / (1.0 - prior[k])
        later += hit[k]
        reached[k] = later
    return float(later)


@compiled
def assume_front_empty(prior: Floats, first: Floats, none: float, evidence: RayEvidence) -> float:
    """P(o) of the conventional method, which takes all cells before the one that explains the measurement as empty.

    Cell k explains the measurement with the weight P(E_k); no cell does with the probability that all are empty. So P(o | E_k)
    is P(o | first = k), and P(o | not E_k) is the weighted mean over the cells behind k. Arguments as in `hidden_chain`.
    """
    occupied, empty, reached = evidence.occupied, evidence.empty, evidence.reached
    # Over the cells behind k: all empty, sum of P(E), sum of P(E) P(o | first)
    clear, weight, mass = (
        1.0,
        0.0,
        0.0,
    )
    for k in range(prior.shape[0] - 1, -1, -1):
        occupied[k], empty[k] = first[k], (mass + clear * none) / (weight + clear)
        clear *= 1.0 - prior[k]
        weight += prior[k]
        mass += prior[k] * first[k]
        reached[k] = mass + clear * none
    for k in range(prior.shape[0]):
        reached[k] /= weight + clear
    return float((mass + clear * none) / (weight + clear))


def likelihoods_of_rays(
    priors: CellPriors, firsts: Floats, nones: Floats, front_is_empty: bool
) -> RayEvidence:
    """Evidence `(m, n)` of m rays of n cells, divided by P(o): see `hidden_chain`.

    `firsts` `(m, n)` and `nones` `(m,)` are P(o | first = k) and P(o | no obstacle). The three likelihoods of the paper:
    `front_is_empty` (independent), correlations of 0 (occlusion), or any others (chain).
    """
    m, n = priors.occupied.shape
    occupied, empty, reached = np.empty((m, n)), np.empty((m, n)), np.empty((m, n))
    run_in_ranges(_likelihoods_of_rays, m, (priors, firsts, nones, front_is_empty, occupied, empty, reached))
    return RayEvidence(occupied, empty, reached)


@compiled
def _likelihoods_of_rays(
    first: int,
    last: int,
    priors: CellPriors,
    firsts: Floats,
    nones: Floats,
    front_is_empty: bool,
    occupied: NDArray[np.float64],
    empty: NDArray[np.float64],
    reached: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `likelihoods_of_rays`."""
    for i in range(first, last):
        ray = RayEvidence(occupied[i], empty[i], reached[i])
        if front_is_empty:
            total = assume_front_empty(priors.occupied[i], firsts[i], nones[i], ray)
        else:
            cells = CellPriors(priors.occupied[i], priors.correlation[i])
            total = hidden_chain(cells, firsts[i], nones[i], ray)
        occupied[i] /= total
        empty[i] /= total
        reached[i] /= total


def expected_behind(reached: Floats, correlations: Floats, prior: float) -> Floats:
    """P(E_k | o) `(m, n)` if nothing but the chain and the one `prior` is known behind the first obstacle of a ray.

    `reached` `(m, n)` is P(nothing before k is occupied | o), `correlations` `(m, n)` are those of each cell with the one before
    it, both as in `likelihoods_of_rays`. The cells before the first obstacle are empty.
    """
    m, n = reached.shape
    expected = np.empty((m, n))
    run_in_ranges(_expected_behind, m, (reached, correlations, prior, expected))
    return expected


@compiled
def _expected_behind(
    begin: int,
    end: int,
    reached: Floats,
    correlations: Floats,
    prior: float,
    expected: NDArray[np.float64],
) -> None:
    """Fill in the items begin to end - 1 of `expected_behind`."""
    n = reached.shape[1]
    for i in range(begin, end):
        occupied, hidden = 0.0, 0.0  # P(first < k, E_k), P(first < k)
        for k in range(n):
            r = correlations[i, k]
            occupied = occupied * (prior + r * (1.0 - prior)) + (hidden - occupied) * prior * (1.0 - r)
            first = reached[i, k] - reached[i, k + 1] if k + 1 < n else 0.0
            occupied += first
            hidden += first
            expected[i, k] = occupied
