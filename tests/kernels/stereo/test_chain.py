"""The exact chain against an enumeration of all states, and the three likelihoods of a false match."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gridslam.kernels.stereo.chain import (
    CellPriors,
    RayEvidence,
    bounded_covariance,
    expected_behind,
    likelihoods_of_rays,
)
from tests.reference import chain as reference

Floats = NDArray[np.float64]

inside = st.floats(0.01, 0.99)
measured = st.floats(1e-3, 5.0)


@st.composite
def rays(draw: st.DrawFn) -> tuple[list[float], list[float], list[float], float]:
    n = draw(st.integers(1, 10))
    return (
        draw(st.lists(inside, min_size=n, max_size=n)),
        draw(st.lists(st.floats(-1.0, 1.0), min_size=n, max_size=n)),
        draw(st.lists(measured, min_size=n, max_size=n)),
        draw(measured),
    )


def evidence_of(
    prior: Floats, correlation: Floats, first: Floats, none: float, front_is_empty: bool = False
) -> RayEvidence:
    """Evidence `(1, n)` of one ray."""
    priors = CellPriors(prior[None], correlation[None])
    found: RayEvidence = likelihoods_of_rays(priors, first[None], np.array([none]), front_is_empty)
    return found


def posteriors(prior: Floats, correlation: Floats, first: Floats, none: float) -> Floats:
    """P(E_k | o) by the kernel."""
    occupied, empty, _ = evidence_of(prior, correlation, first, none)
    np.testing.assert_allclose(occupied[0] * prior + empty[0] * (1 - prior), 1.0, atol=1e-12)
    return np.asarray(occupied[0] * prior / (occupied[0] * prior + empty[0] * (1 - prior)))


@given(rays())
@settings(max_examples=200, deadline=None)
def test_the_chain_is_exact(ray: tuple[list[float], list[float], list[float], float]) -> None:
    prior, correlation, first, none = ray
    expected, _ = reference.posterior(prior, correlation, first, none)
    found = posteriors(np.array(prior), np.array(correlation), np.array(first), none)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@given(rays())
@settings(max_examples=60, deadline=None)
def test_without_correlation_the_cells_are_independent(
    ray: tuple[list[float], list[float], list[float], float],
) -> None:
    prior, _, first, none = (np.array(v) for v in ray)
    n = len(prior)
    clear = np.concatenate([[1.0], np.cumprod(1.0 - prior)])
    total = float((prior * clear[:-1] * first).sum() + clear[-1] * none)
    earlier = np.concatenate([[0.0], np.cumsum(prior * clear[:-1] * first)])[:n]
    expected = (earlier * prior + prior * clear[:-1] * first) / total
    found = posteriors(prior, np.zeros(n), first, float(none))
    np.testing.assert_allclose(found, expected, atol=1e-12)


@given(inside, inside, st.floats(-1.0, 1.0))
def test_the_joint_distribution_of_neighbours_exists(p: float, p_next: float, r: float) -> None:
    both = p * p_next + bounded_covariance(p, p_next, r)
    table = [both, p - both, p_next - both, 1.0 - p - p_next + both]
    assert min(table) >= -1e-12
    assert sum(table) == pytest.approx(1.0)


def ratio_of_a_hidden_obstacle(r: float, front_is_empty: bool) -> float:
    """P(o|E) / P(o|not E) of a cell with p near 1 in known free space, for a match behind it."""
    prior = np.full(60, 0.002)
    prior[20] = 0.999
    false, peak = 0.05 / 64, 0.8
    first = np.full(60, false)
    first[45] += peak
    occupied, empty, _ = evidence_of(prior, np.full(60, r), first, false, front_is_empty)
    return float(occupied[0, 20] / empty[0, 20])


def test_a_match_behind_a_certain_obstacle_is_no_evidence_against_it_except_conventionally() -> None:
    assert ratio_of_a_hidden_obstacle(0.978, False) == pytest.approx(1.0, abs=0.05)
    assert ratio_of_a_hidden_obstacle(0.978, True) < 0.5


def test_cells_of_probability_near_zero_and_one_remain_finite() -> None:
    prior = np.array([1e-9, 1.0 - 1e-9, 1e-9, 0.5, 1.0 - 1e-9])
    occupied, empty, _ = evidence_of(prior, np.full(5, 0.999), np.full(5, 1e-6), 1e-6)
    assert np.isfinite(occupied).all()
    assert np.isfinite(empty).all()


@given(rays())
@settings(max_examples=60, deadline=None)
def test_a_cell_is_reached_if_no_cell_before_it_is_occupied(
    ray: tuple[list[float], list[float], list[float], float],
) -> None:
    prior, correlation, first, none = ray
    _, _, reached = evidence_of(np.array(prior), np.array(correlation), np.array(first), none)
    expected = [reference.reached(k, prior, correlation, first, none) for k in range(len(prior))]
    np.testing.assert_allclose(reached[0], expected, atol=1e-12)


def test_the_expectation_behind_an_obstacle_is_the_chain_continued_from_it() -> None:
    rng = np.random.default_rng(3)
    first, prior = rng.dirichlet(np.ones(7)), 0.25  # the last one: no obstacle
    correlation = rng.uniform(0.5, 1.0, 6)
    expected = reference.expected_behind(first[:6], correlation, prior)
    reached = 1.0 - np.concatenate([[0.0], np.cumsum(first)[:5]])
    found = expected_behind(reached[None], correlation[None], prior)[0]
    # An obstacle in the last cell is not distinguished from none
    assert found[:5] == pytest.approx(expected[:5], abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_long_rays_agree_with_the_sum_over_the_first_occupied_cell(seed: int) -> None:
    rng = np.random.default_rng(seed)
    prior, correlation, first = (
        rng.uniform(0.01, 0.9, 50),
        rng.uniform(-0.5, 1.0, 50),
        rng.uniform(0.0, 3.0, 50),
    )
    found = evidence_of(prior, correlation, first, 0.3)
    expected = reference.likelihoods(prior, correlation, first, 0.3)
    for ours, row in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours[0], row, rtol=1e-9, atol=1e-12)
