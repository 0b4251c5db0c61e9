"""The size of wall segments that readings can resolve: several times the distance between consecutive readings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gridslam.methods.ir_scan.stops import Stop
from gridslam.sensors.infrared import ReliableReadings, spacing_m

MIN_WINDOW_M = 0.1
READINGS_PER_WINDOW = 4.0


def window_of(scans: Sequence[ReliableReadings]) -> float:
    """A window (m) that holds about four readings of one sweep, at least 10 cm."""
    spacing = spacing_m(scans)
    return MIN_WINDOW_M if math.isnan(spacing) else max(MIN_WINDOW_M, READINGS_PER_WINDOW * spacing)


def scans_of(stops: Sequence[Stop]) -> list[ReliableReadings]:
    """The reliable readings of all stops that have a scan."""
    return [stop.readings for stop in stops if stop.readings is not None]
