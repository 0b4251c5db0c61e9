"""Cosine and sine by polynomials against the library's."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from gridslam.kernels.angles import cos_sin


@given(st.floats(-1000.0, 1000.0))
def test_cosine_and_sine_are_those_of_the_library(angle):
    cos, sin = cos_sin(angle)
    assert abs(cos - math.cos(angle)) < 3e-16
    assert abs(sin - math.sin(angle)) < 3e-16
