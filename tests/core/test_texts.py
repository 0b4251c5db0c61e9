"""Words of text files as numbers."""

from __future__ import annotations

import math

import pytest

from gridslam.core.errors import LogError
from gridslam.core.stamps import parse_stamp
from gridslam.core.texts import is_number, parse_number, parse_numbers

NONE = ["1_000", "\u0661", "\uff11.5", "1e1_0", "", "x", "0x10", "1\u00a0"]


@pytest.mark.parametrize("word", NONE)
def test_what_only_python_takes_for_a_number_is_none(word: str) -> None:
    assert not is_number(word)
    assert not is_number(word.encode())
    assert parse_stamp(word) is None
    for words in ([word], ["1", word], [word.encode()]):
        with pytest.raises(ValueError):
            parse_numbers(words)


def test_numbers_are_read_as_float_reads_them() -> None:
    words = ["1", "-2.5", " 3 ", "1e-3", "inf", "+.5"]
    assert parse_numbers(words) == [float(word) for word in words]
    assert parse_numbers([word.encode() for word in words]) == parse_numbers(words)
    assert math.isnan(parse_number("nan")) and math.isnan(parse_number(b"NaN"))
    assert parse_numbers([]) == []


def test_an_error_that_repeats_a_long_name_keeps_its_beginning_and_its_end() -> None:
    text = str(LogError(f"log.csv: no column {'a' * 100_000!r} where the ranges begin"))
    assert len(text) < 2010
    assert text.startswith("log.csv: no column 'aaa")
    assert text.endswith("aaa' where the ranges begin")
