"""Strings: whether every log format can store them, whether they are numbers, and how to show them safely."""

from __future__ import annotations

import re
from collections.abc import Sequence

# Control characters but tab and line feed, invisible characters, line separators, and marks that change the direction of writing.
_INVISIBLE = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200b-\\u200f\\u2028-\\u202e\\u2060-\\u206f\\ufeff]"
)
MAX_LINE = 2000  # largest number of characters of a message to the user


def is_storable(text: str) -> bool:
    """Whether every log format can store a string: it has no NUL, which ends a ROS string, and no lone surrogate."""
    try:
        return b"\0" not in text.encode()
    except UnicodeEncodeError:
        return False


def parse_number(word: str | bytes) -> float:
    """The number in a word of a text file; infinities and NaN are numbers. Raises ValueError: it is not a number.

    Unlike `float`, it refuses what other programs do not read: `1_000`, and digits other than 0 to 9.
    """
    if isinstance(word, bytes):
        word = word.decode("ascii")
    if "_" in word or not word.isascii():
        raise ValueError(f"{word!r} is not a number")
    return float(word)


def parse_numbers(words: Sequence[str] | Sequence[bytes]) -> list[float]:
    """The numbers in many words, as `parse_number` reads them. Raises ValueError: one is not a number."""
    joined = b"".join(words) if words and isinstance(words[0], bytes) else "".join(words)  # type: ignore[arg-type]
    if (b"_" if isinstance(joined, bytes) else "_") in joined or not joined.isascii():  # type: ignore[operator]
        raise ValueError("a word is not a number")
    return list(map(float, words))


def is_number(word: str | bytes) -> bool:
    """Whether a word is a number, infinities and NaN included."""
    try:
        parse_number(word)
    except ValueError:
        return False
    return True


def visible(text: str) -> str:
    """The text with escapes such as `\\u202e` in place of characters that would act on the reader's screen or hide."""
    return _INVISIBLE.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def shortened(line: str) -> str:
    """The line, without its middle if it is longer than a screen."""
    if len(line) <= MAX_LINE:
        return line
    half = MAX_LINE // 2
    return f"{line[:half]} ... {line[-half:]}"
