"""Coordinates between commas, as options of commands state them."""

from __future__ import annotations

import math
from collections.abc import Collection

from gridslam.core.errors import ConfigError
from gridslam.core.poses import MAX_COORDINATE_M
from gridslam.core.texts import parse_numbers


def coordinates(option: str, text: str, counts: Collection[int], form: str) -> list[float]:
    """The numbers of a text `X,Y` or `X,Y,YAW`, as many as one of `counts`.

    Raises ConfigError, which names the option and the expected `form`: another count, a word, or a number beyond
    `MAX_COORDINATE_M`.
    """
    try:
        values = parse_numbers(text.split(","))
    except ValueError:
        values = []
    if len(values) not in counts or not all(map(math.isfinite, values)):
        raise ConfigError(f"{option} {text}: expected {form}")
    if max(map(abs, values)) > MAX_COORDINATE_M:
        raise ConfigError(f"{option} {text}: a number is larger than {MAX_COORDINATE_M:g}; expected {form}")
    return values
