"""The Markov chain of cells along a ray, by enumeration of all states."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from math import sqrt


def joint(p: float, p_next: float, r: float) -> float:
    """P(both occupied) of two neighbours with correlation r, within the Frechet limits."""
    wanted = p * p_next + r * sqrt(p * (1 - p) * p_next * (1 - p_next))
    return min(max(wanted, max(0.0, p + p_next - 1.0)), min(p, p_next))


def probability(states: Sequence[int], prior: Sequence[float], correlation: Sequence[float]) -> float:
    """Probability of one state of all cells."""
    found = prior[0] if states[0] else 1.0 - prior[0]
    for k, (before, now) in enumerate(pairwise(states), start=1):
        p, p_next = prior[k - 1], prior[k]
        both = joint(p, p_next, correlation[k])
        table = {(1, 1): both, (1, 0): p - both, (0, 1): p_next - both, (0, 0): 1.0 - p - p_next + both}
        found *= table[before, now] / (p if before else 1.0 - p)
    return found


def posterior(
    prior: Sequence[float], correlation: Sequence[float], first: Sequence[float], none: float
) -> tuple[list[float], float]:
    """P(E_k | o) of every cell, and P(o)."""
    total, occupied = 0.0, [0.0] * len(prior)
    for states in product((0, 1), repeat=len(prior)):
        likelihood = first[states.index(1)] if 1 in states else none
        mass = probability(states, prior, correlation) * likelihood
        total += mass
        for k, state in enumerate(states):
            occupied[k] += state * mass
    return [mass / total for mass in occupied], total


def reached(
    cell: int, prior: Sequence[float], correlation: Sequence[float], first: Sequence[float], none: float
) -> float:
    """P(no cell before this one is occupied | o)."""
    total = clear = 0.0
    for states in product((0, 1), repeat=len(prior)):
        mass = probability(states, prior, correlation) * (first[states.index(1)] if 1 in states else none)
        total += mass
        clear += 0.0 if 1 in states[:cell] else mass
    return clear / total


def likelihoods(
    prior: Sequence[float], correlation: Sequence[float], first: Sequence[float], none: float
) -> tuple[list[float], list[float], list[float]]:
    """P(o | E_k) / P(o), P(o | not E_k) / P(o) and P(nothing before k is occupied | o), for rays too long to enumerate.

    The sum runs over the first occupied cell; behind it the P(E) of each cell follows from that of the cell before.
    """
    n = len(prior)
    masses, clear = [], 1.0  # P(o, first = k) for every k, then P(o, none is occupied)
    occupied = [0.0] * n  # P(o, E_k)
    for hit in range(n):
        p = prior[hit]
        if hit:
            p -= joint(prior[hit - 1], prior[hit], correlation[hit])
            p /= 1.0 - prior[hit - 1]
        masses.append(first[hit] * clear * p)
        clear *= 1.0 - p
        chance = 1.0
        for k in range(hit, n):
            if k > hit:
                both = joint(prior[k - 1], prior[k], correlation[k])
                chance = chance * both / prior[k - 1] + (1 - chance) * (prior[k] - both) / (1 - prior[k - 1])
            occupied[k] += masses[hit] * chance
    masses.append(none * clear)
    total = sum(masses)
    return (
        [mass / p / total for mass, p in zip(occupied, prior, strict=True)],
        [(total - mass) / (1.0 - p) / total for mass, p in zip(occupied, prior, strict=True)],
        [sum(masses[k:]) / total for k in range(n)],
    )


def expected_behind(first: Sequence[float], correlation: Sequence[float], prior: float) -> list[float]:
    """P(E_k) if cell k is the first occupied one with probability `first[k]` and the chain continues behind it."""
    expected = [0.0] * len(first)
    for hit, mass in enumerate(first):
        chance = 1.0
        for k in range(hit, len(first)):
            if k > hit:
                r = correlation[k]
                chance = chance * (prior + r * (1.0 - prior)) + (1.0 - chance) * prior * (1.0 - r)
            expected[k] += mass * chance
    return expected
