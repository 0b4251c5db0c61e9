"""The exact chain against counting through all states, and what the three likelihoods make of a false match."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gridslam.kernels.chain import bounded_covariance, expected_behind, likelihoods_of_rays
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


def posteriors(prior: Floats, correlation: Floats, first: Floats, none: float) -> Floats:
    """P(E_k | o) by the kernel."""
    occupied, empty, _ = likelihoods_of_rays(
        prior[None], correlation[None], first[None], np.array([none]), False
    )
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
def test_without_correlation_it_is_the_first_of_independent_cells(
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


def ratio_of_a_hidden_obstacle(r: float, front: bool) -> float:
    """P(o|E) / P(o|not E) of a cell with p near 1 in known free space, when something is matched behind it."""
    prior = np.full(60, 0.002)
    prior[20] = 0.999
    false, peak = 0.05 / 64, 0.8
    first = np.full(60, false)
    first[45] += peak
    occupied, empty, _ = likelihoods_of_rays(
        prior[None], np.full((1, 60), r), first[None], np.array([false]), front
    )
    return float(occupied[0, 20] / empty[0, 20])


def test_a_match_behind_a_sure_obstacle_says_nothing_about_it_where_the_conventional_method_doubts_it() -> (
    None
):
    assert ratio_of_a_hidden_obstacle(0.978, False) == pytest.approx(1.0, abs=0.05)
    assert ratio_of_a_hidden_obstacle(0.978, True) < 0.5


def test_cells_of_probability_near_zero_and_one_stay_finite() -> None:
    prior = np.array([1e-9, 1.0 - 1e-9, 1e-9, 0.5, 1.0 - 1e-9])
    occupied, empty, _ = likelihoods_of_rays(
        prior[None], np.full((1, 5), 0.999), np.full((1, 5), 1e-6), np.array([1e-6]), False
    )
    assert np.isfinite(occupied).all()
    assert np.isfinite(empty).all()


@given(rays())
@settings(max_examples=60, deadline=None)
def test_a_cell_is_reached_when_nothing_stands_before_it(
    ray: tuple[list[float], list[float], list[float], float],
) -> None:
    prior, correlation, first, none = ray
    _, _, reached = likelihoods_of_rays(
        np.array(prior)[None], np.array(correlation)[None], np.array(first)[None], np.array([none]), False
    )
    expected = [reference.reached(k, prior, correlation, first, none) for k in range(len(prior))]
    np.testing.assert_allclose(reached[0], expected, atol=1e-12)


def test_what_is_expected_behind_is_the_chain_run_on_from_the_first_hit() -> None:
    rng = np.random.default_rng(3)
    first, prior = rng.dirichlet(np.ones(7)), 0.25  # the last: nothing on the ray
    correlation = rng.uniform(0.5, 1.0, 6)
    expected = reference.expected_behind(first[:6], correlation, prior)
    reached = 1.0 - np.concatenate([[0.0], np.cumsum(first)[:5]])
    found = expected_behind(reached[None], correlation[None], prior)[0]
    assert found[:5] == pytest.approx(expected[:5], abs=1e-12)  # the last cell's hit cannot be told from none


@pytest.mark.parametrize("seed", range(3))
def test_long_rays_are_the_sum_over_the_cells_that_may_be_the_first(seed: int) -> None:
    rng = np.random.default_rng(seed)
    prior, correlation, first = (
        rng.uniform(0.01, 0.9, 50),
        rng.uniform(-0.5, 1.0, 50),
        rng.uniform(0.0, 3.0, 50),
    )
    found = likelihoods_of_rays(prior[None], correlation[None], first[None], np.array([0.3]), False)
    expected = reference.likelihoods(prior, correlation, first, 0.3)
    for ours, row in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours[0], row, rtol=1e-9, atol=1e-12)
