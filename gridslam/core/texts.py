"""Texts that every format can hold."""

from __future__ import annotations


def is_storable(text: str) -> bool:
    """Whether every format holds a text: it has no zero, which ends a string of ROS, and no half character (lone surrogate)."""
    try:
        return b"\0" not in text.encode()
    except UnicodeEncodeError:
        return False
