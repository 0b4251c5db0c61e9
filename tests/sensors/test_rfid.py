from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.sensors.rfid import OPEN_M, PROFILE_BINS, AntennaModel, RoundGeometry, range_profile
from tests.reference.object_weights import read_probability

MODEL = AntennaModel()


def open_rounds(antennas: np.ndarray, profile: np.ndarray | None = None) -> RoundGeometry:
    if profile is None:
        profile = np.full(PROFILE_BINS, OPEN_M)
    return RoundGeometry(antennas, np.zeros(len(antennas), np.int64), np.zeros((1, 3)), profile[None])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_likelihood_is_the_product_over_the_rounds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tags = np.column_stack([rng.uniform(-2, 2, (4, 2)), rng.uniform(-np.pi, np.pi, 4)])
    antennas = np.column_stack([rng.uniform(-2, 2, (9, 2)), rng.uniform(-np.pi, np.pi, 9)])
    is_read = rng.random(9) < 0.5
    fast = open_rounds(antennas).log_likelihood(tags, is_read, MODEL)
    for tag, found in zip(tags, fast, strict=True):
        chances = [min(read_probability(tag, antenna, False, MODEL), 0.99) for antenna in antennas]
        slow = sum(math.log(p if read else 1.0 - p) for p, read in zip(chances, is_read, strict=True))
        np.testing.assert_allclose(found, slow, rtol=1e-9)


def test_a_tag_is_read_less_when_far_beside_the_axis_turned_away_or_hidden() -> None:
    antenna, read = np.zeros((1, 3)), np.array([True])
    facing = np.array([1.0, 0.0, math.pi])
    worse = np.array([[1.9, 0.0, math.pi], [0.0, 1.0, -math.pi / 2], [1.0, 0.0, 0.0]])
    best, *others = open_rounds(antenna).log_likelihood(np.vstack([facing, worse]), read, MODEL)
    hidden = open_rounds(antenna, np.full(PROFILE_BINS, 0.5)).log_likelihood(facing[None], read, MODEL)[0]
    assert all(other < best - 0.1 for other in [*others, hidden])


def test_silence_speaks_against_tags_that_would_have_been_read() -> None:
    tags = np.array([[1.0, 0.0, math.pi], [6.0, 0.0, math.pi]])
    near, far = open_rounds(np.zeros((5, 3))).log_likelihood(tags, np.zeros(5, np.bool_), MODEL)
    assert near < -8.0
    assert far > -0.1


def test_a_profile_holds_what_was_seen_in_each_direction_and_is_open_elsewhere() -> None:
    profile = range_profile(np.array([[2.0, 0.01], [0.0, 3.0]]), np.zeros(3))
    assert profile[0] == np.hypot(2.0, 0.01)
    assert profile[90] == 3.0
    assert profile[180] == OPEN_M
    turned = range_profile(np.array([[0.0, 3.0]]), np.array([0.0, 0.0, np.pi / 2 - 0.01]))
    assert turned[0] == 3.0
