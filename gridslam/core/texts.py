"""Texts that files and terminals can hold."""

from __future__ import annotations


def is_unicode(text: str) -> bool:
    """Whether a text has a form in UTF-8: no half of a character (a lone surrogate) is in it."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
