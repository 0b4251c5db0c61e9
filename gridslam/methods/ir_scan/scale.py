"""How long the pieces of wall are that readings can show: several times the distance between neighbouring readings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gridslam.methods.ir_scan.stops import Place
from gridslam.sensors.infrared import BeamEnds, spacing_m

_LEAST_WINDOW_M = 0.1
_READINGS = 4.0


def window_of(scans: Sequence[BeamEnds]) -> float:
    """A window (m) with about four readings of one sweep, at least 10 cm."""
    spacing = spacing_m(scans)
    return _LEAST_WINDOW_M if math.isnan(spacing) else max(_LEAST_WINDOW_M, _READINGS * spacing)


def scans_of(places: Sequence[Place]) -> list[BeamEnds]:
    """The reliable readings of all places that have a scan."""
    return [place.ends for place in places if place.ends is not None]
