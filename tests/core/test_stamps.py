from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridslam.core.stamps import END_NS, format_stamp, join_stamp, parse_stamp, split_stamp


@pytest.mark.parametrize(
    ("text", "unit", "stamp_ns"),
    [
        ("70.289900", "s", 70_289_900_000),
        ("1134864629.895182", "s", 1_134_864_629_895_182_000),
        ("1663967370.849346434", "s", 1_663_967_370_849_346_434),  # a float64 would lose the last two digits
        ("0.1", "s", 100_000_000),
        (".5", "s", 500_000_000),
        ("5.", "s", 5_000_000_000),
        ("1.5e9", "s", 1_500_000_000_000_000_000),
        (" 7 ", "s", 7_000_000_000),
        ("1.2345678901", "s", 1_234_567_890),
        ("1234.5", "ms", 1_234_500_000),
        ("12", "us", 12_000),
        ("12.9", "ns", 12),
    ],
)
def test_decimal_seconds_become_nanoseconds_without_rounding(text: str, unit: str, stamp_ns: int) -> None:
    assert parse_stamp(text, unit) == stamp_ns


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "-1", "-0.5", "abc", "1e400", "2147483648", "9" * 500, "1,5", "0x10"]
)
def test_what_is_no_stamp_is_none(text: str) -> None:
    assert parse_stamp(text) is None


@given(st.integers(0, END_NS - 1))
def test_a_formatted_stamp_reads_back(stamp_ns: int) -> None:
    assert parse_stamp(format_stamp(stamp_ns)) == stamp_ns


@given(st.integers(-(2**31), 2**32), st.integers(0, 2**32))
def test_ros_stamps_are_joined_or_refused(seconds: int, nanoseconds: int) -> None:
    joined = join_stamp(seconds, nanoseconds)
    valid = 0 <= seconds < 2**31 and nanoseconds < 10**9
    assert joined == (seconds * 10**9 + nanoseconds if valid else None)


@given(st.integers(0, END_NS - 1))
def test_split_stamps_are_joined_again(stamp_ns: int) -> None:
    assert join_stamp(*split_stamp(stamp_ns)) == stamp_ns
