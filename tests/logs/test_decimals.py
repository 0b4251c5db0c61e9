from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridslam.logs.carmen.decimals import parse_decimals

words = st.one_of(
    st.floats(allow_nan=False).map(repr),
    st.integers(-(10**18), 10**18).map(str),
    st.decimals(-(10**6), 10**6, allow_nan=False, places=6).map(lambda d: f"{d:f}"),
    st.sampled_from(["-0.0", ".5", "5.", "00.10", "1e5", "inf", "-nan", "+3", "123456789012345678.5"]),
)


@given(st.lists(words, min_size=1, max_size=30))
def test_every_number_is_the_one_that_float_gives(texts: list[str]) -> None:
    found = parse_decimals(" ".join(texts).encode())
    np.testing.assert_array_equal(found, np.array([float(text) for text in texts]))
    np.testing.assert_array_equal(np.signbit(found), np.signbit([float(text) for text in texts]))


@pytest.mark.parametrize("text", [b"", b"1  2", b"1 x", b"1_0", b"1.2.3", b"-", b"1-2", b" 1", b"1 "])
def test_a_word_that_is_not_a_number_is_refused(text: bytes) -> None:
    with pytest.raises(ValueError):
        parse_decimals(text)
