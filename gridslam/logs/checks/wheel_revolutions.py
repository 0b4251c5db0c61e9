"""Wheel angles that restart from zero at each revolution are made continuous."""

from __future__ import annotations

import math
from dataclasses import replace

from gridslam.core.messages import WheelTicks
from gridslam.logs.message_counts import MessageCounts

REVOLUTION_RAD = 2.0 * math.pi
TOLERANCE_RAD = 0.1  # excess of an angle over one revolution that is tolerated


class WheelRevolutions:
    """Adds the turns that the angles of one stream lack. Angles that have left one turn are continuous already.

    `label` is the stream's name in messages to the user.
    """

    def __init__(self, label: str, message_counts: MessageCounts) -> None:
        self._label = label
        self._message_counts = message_counts
        self._is_wrapped = True  # as far as seen
        self._last: tuple[float, float] | None = None  # as recorded
        self._revolutions = [0, 0]

    def repaired(self, ticks: WheelTicks) -> WheelTicks:
        """The angles with whole turns added; the same object where there are none."""
        angles = ticks.left_rad, ticks.right_rad
        if not self._is_wrapped or not all(map(math.isfinite, angles)):
            return ticks
        if not all(-math.pi - TOLERANCE_RAD <= a <= REVOLUTION_RAD + TOLERANCE_RAD for a in angles):
            self._is_wrapped = any(self._revolutions)
        if self._is_wrapped and self._last is not None:
            for side, (now, before) in enumerate(zip(angles, self._last, strict=True)):
                self._revolutions[side] -= round((now - before) / REVOLUTION_RAD)
        self._last = angles
        if not any(self._revolutions):
            return ticks
        self._message_counts.find(f"{self._label}: wheel angles start anew at each turn: turns are added")
        left, right = (
            angle + REVOLUTION_RAD * revolutions
            for angle, revolutions in zip(angles, self._revolutions, strict=True)
        )
        return replace(ticks, left_rad=left, right_rad=right)
