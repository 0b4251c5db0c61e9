"""Texts: whether every format can hold them, whether they are numbers, and how to show all that they hold."""

from __future__ import annotations

import re
from collections.abc import Sequence

# Control characters but tab and line feed, invisible characters, line separators, and marks that change the direction of writing.
_INVISIBLE = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200b-\\u200f\\u2028-\\u202e\\u2060-\\u206f\\ufeff]"
)
MAX_LINE = 2000  # characters of a message to the user


def is_storable(text: str) -> bool:
    """Whether every format holds a text: it has no zero, which ends a string of ROS, and no half character (lone surrogate)."""
    try:
        return b"\0" not in text.encode()
    except UnicodeEncodeError:
        return False


def parse_number(word: str | bytes) -> float:
    """The number that a word of a text file is, infinities and NaN included. Raises ValueError: it is none.

    Python's own `float` takes more than other programs do: `1_000`, and digits of all scripts.
    """
    if isinstance(word, bytes):
        word = word.decode("ascii")
    if "_" in word or not word.isascii():
        raise ValueError(f"{word!r} is not a number")
    return float(word)


def parse_numbers(words: Sequence[str] | Sequence[bytes]) -> list[float]:
    """The numbers that many words are, as `parse_number` reads each. Raises ValueError: one is none."""
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
    """The line without its middle, where it is longer than a screen."""
    if len(line) <= MAX_LINE:
        return line
    half = MAX_LINE // 2
    return f"{line[:half]} ... {line[-half:]}"
