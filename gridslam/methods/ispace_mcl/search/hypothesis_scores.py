"""Scores of hypotheses about the robot's pose that allow for its having been carried elsewhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.ispace_mcl.continuity import DISCONTINUOUS_OVERLAP, WHOLE_OVERLAP

Floats = NDArray[np.float64]

KIDNAPPING_LOG_ODDS = 10.0  # against the robot having been carried elsewhere ...
DISCONTINUOUS_LOG_ODDS = 2.0  # ... and where a scan does not continue the one before it


def kidnapping_log_odds(overlaps: Floats) -> Floats:
    """Log-odds `(k,)` against the robot having been carried just before each scan, by the overlap `(k,)` with the scan before."""
    known = (DISCONTINUOUS_OVERLAP, WHOLE_OVERLAP)
    return np.interp(overlaps, known, (DISCONTINUOUS_LOG_ODDS, KIDNAPPING_LOG_ODDS))


def with_kidnapping(others: Floats, own: Floats, prices: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Scores `(n,)` of hypotheses over k scans `(k, n)`, latest first, that allow for the robot having been carried there.

    A hypothesis explains all scans itself. Or it explains only the latest ones, at the price `(k - 1,)` of having been carried
    just before the earliest of these, and leaves the older ones to the tracked pose with the scores `own` `(k,)`. The second
    result `(n,)` is the number of scans that each explains itself.
    """
    latest = np.cumsum(others, axis=0)
    older = own.sum() - np.cumsum(own)
    latest[:-1] += (older[:-1] - prices)[:, None]
    first = latest.argmax(axis=0)
    return np.take_along_axis(latest, first[None], axis=0)[0], first + 1
