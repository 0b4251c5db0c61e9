from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core import poses as se2
from gridslam.kernels import object_weights
from gridslam.kernels.object_weights import EndpointMixture, ObservedBeams
from tests.reference.object_weights import face_met, footprint_gain, is_on

BOX = np.array([[-0.2, -0.25], [0.2, -0.25], [0.2, 0.25], [-0.2, 0.25]])
LEAF = np.array([[0.0, -0.02], [0.9, -0.02], [0.9, 0.02], [0.0, 0.02]])
MIXTURE = EndpointMixture(0.02, 0.05, 0.3)
SEEDS = st.integers(0, 2**32 - 1)


def random_beams(rng: np.random.Generator, n: int) -> np.ndarray:
    angle = rng.uniform(-np.pi, np.pi, n)
    return np.column_stack([rng.uniform(-2, 2, (n, 2)), np.cos(angle), np.sin(angle)])


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.sampled_from([0.02, 0.3]))
def test_the_gain_is_the_sum_over_the_mixture_of_each_beam(seed: int, sigma: float) -> None:
    rng = np.random.default_rng(seed)
    for footprint in (BOX, LEAF):
        poses = np.column_stack([rng.uniform(-1, 1, (3, 2)), rng.uniform(-np.pi, np.pi, 3)])
        beams, ranges = random_beams(rng, 40), rng.uniform(0.1, 3.0, 40)
        background = np.where(rng.random(40) < 0.5, np.inf, np.abs(rng.normal(0.0, sigma, 40)))
        arguments = (footprint, ObservedBeams(beams, ranges, background), EndpointMixture(sigma, 0.05, 0.3))
        fast = object_weights.footprint_gains(poses, *arguments)
        np.testing.assert_allclose(fast, [footprint_gain(p, *arguments) for p in poses], rtol=1e-6, atol=1e-3)


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_endpoints_lie_behind_the_face_that_their_beam_meets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = se2.transform_points(np.array([*rng.uniform(-1, 1, 2), rng.uniform(-3, 3)]), BOX)
    beams, ranges = random_beams(rng, 30), rng.uniform(0.1, 3.0, 30)
    behind = object_weights.distances_behind(corners, beams, ranges)
    for beam, reading, found in zip(beams, ranges, behind, strict=True):
        met = face_met(corners, beam)
        expected = np.inf if met is None else (reading - met[0]) * met[1]
        np.testing.assert_allclose(found, expected, atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.floats(0.0, 0.2))
def test_points_in_and_near_a_footprint_are_marked(seed: int, margin_m: float) -> None:
    rng = np.random.default_rng(seed)
    corners = se2.transform_points(np.array([*rng.uniform(-1, 1, 2), rng.uniform(-3, 3)]), LEAF)
    points = rng.uniform(-2, 2, (60, 2))
    marked = np.zeros(60, np.bool_)
    object_weights.mark_points_on(points, corners, margin_m, marked)
    np.testing.assert_array_equal(marked, [is_on(p, corners, margin_m) for p in points])


def test_an_endpoint_in_front_of_the_footprint_gains_and_loses_nothing() -> None:
    beams, pose = np.array([[-2.0, 0.0, 1.0, 0.0]]), np.zeros((1, 3))
    gain = object_weights.footprint_gains(
        pose, BOX, ObservedBeams(beams, np.array([0.5]), np.array([np.inf])), MIXTURE
    )
    assert gain[0] == 0.0


def test_a_beam_that_a_wall_explains_gains_nothing_and_loses_if_it_passes_through() -> None:
    beams, pose = np.array([[-2.0, 0.0, 1.0, 0.0]]), np.zeros((1, 3))
    on_both, through = (
        object_weights.footprint_gains(
            pose, BOX, ObservedBeams(beams, np.array([range_m]), np.zeros(1)), MIXTURE
        )
        for range_m in (1.8, 2.5)
    )
    assert abs(on_both[0]) < 1e-9
    assert through[0] < -5.0
