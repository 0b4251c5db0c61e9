"""Random streams: one seed per run, one independent stream per component."""

from __future__ import annotations

import zlib

import numpy as np


def random_stream(seed: int, component: str) -> np.random.Generator:
    """The generator of one named component: the same seed and name give the same numbers, other names independent ones."""
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence([seed, zlib.crc32(component.encode())]))
    )
