"""Random streams: one seed per run, one independent stream per component."""

from __future__ import annotations

import zlib

import numpy as np


def random_stream(seed: int, component: str) -> np.random.Generator:
    """The random generator of a named component: same seed and name, same numbers; other names are independent."""
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence([seed, zlib.crc32(component.encode())]))
    )
