"""Parses the decimal numbers of many lines at once, to the same values as `float`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.texts import parse_number

Floats = NDArray[np.float64]

_SPACE, _MINUS, _DOT, _ZERO = b" -.0"
_MAX_DIGITS = 15  # a float64 holds every integer of 15 digits exactly, and every power of ten up to 10^15
_POWERS = 10.0 ** np.arange(_MAX_DIGITS + 1)


def parse_decimals(text: bytes) -> Floats:
    """The numbers `(n,)` in a text that are separated by single spaces, without spaces at its ends.

    A plain number, of at most 15 digits and without an exponent, is computed as an integer divided by a power of ten; both are
    exact, so the quotient is rounded as `float` does. Other words go through `parse_number`. Raises ValueError: a word is not a
    number.
    """
    if not text:
        raise ValueError("no number")
    characters = np.frombuffer(text, np.uint8)
    spaces = np.flatnonzero(characters == _SPACE)
    starts = np.concatenate([[0], spaces + 1])  # of each word, in `characters`
    ends = np.concatenate([spaces, [len(characters)]])
    # Other characters become numbers above 9: those below "0" wrap round.
    digits = characters - np.uint8(_ZERO)
    is_digit = digits < 10
    digits_before = np.zeros(len(characters) + 1, np.int32)
    np.cumsum(is_digit, out=digits_before[1:], dtype=np.int32)
    first, end = digits_before[starts], digits_before[ends]  # of each word, among all digits
    dots = np.flatnonzero(characters == _DOT)
    word_of_dot = np.searchsorted(ends, dots)
    dot_count = np.bincount(word_of_dot, minlength=len(starts))
    decimals = np.zeros(len(starts), np.int64)
    decimals[word_of_dot] = end[word_of_dot] - digits_before[dots]
    is_negative = characters[np.minimum(starts, len(characters) - 1)] == _MINUS
    count = end - first
    is_plain = (count + dot_count + is_negative == ends - starts) & (dot_count <= 1)
    is_plain &= (count > 0) & (count <= _MAX_DIGITS)
    values = _mantissas(digits[is_digit], first, end) / _POWERS[np.where(is_plain, decimals, 0)]
    np.negative(values, out=values, where=is_negative)
    for word in np.flatnonzero(~is_plain):
        values[word] = parse_number(text[starts[word] : ends[word]])
    return values


def _mantissas(digits: NDArray[np.uint8], first: NDArray[np.int32], end: NDArray[np.int32]) -> Floats:
    """The integers that the digits first[i] to end[i] - 1 form; meaningless for words without digits or with too many."""
    exponents = np.repeat(end, end - first) - np.arange(1, len(digits) + 1, dtype=np.int32)
    terms = np.zeros(len(digits) + 1)
    np.multiply(digits, _POWERS[np.minimum(exponents, _MAX_DIGITS)], out=terms[:-1])
    return np.asarray(np.add.reduceat(terms, first))
