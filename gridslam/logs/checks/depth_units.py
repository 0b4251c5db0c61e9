"""The unit of the depth images of a stream: that of the encoding, or wrong by a factor of a thousand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gridslam.core.messages import DepthImage, readonly
from gridslam.logs.message_counts import MessageCounts

MIN_PIXELS = 100  # number of pixels with a depth that a statement about the unit needs
NEAR_PERCENT, FAR_PERCENT = 5.0, 95.0
MAX_NEAR_M = 100.0  # a depth camera has something nearer than this in its view
MIN_FAR_M = 0.03  # ... and something farther away than this
THOUSAND = 1000.0


class DepthUnits:
    """Scales the depths of one stream if their unit is wrong by a thousand, as its first image with enough depths shows.

    Depths are metres in 32FC1 and millimetres in 16UC1; some drivers write millimetres as floats, or metres as integers.
    """

    def __init__(self, label: str, message_counts: MessageCounts) -> None:
        self._label = label
        self._message_counts = message_counts
        self._factor: float | None = None

    def repaired(self, depth: DepthImage) -> DepthImage:
        """The image in metres; the same object if it already is."""
        if self._factor is None:
            self._factor = self._measured(depth)
        if self._factor in (None, 1.0):
            return depth
        self._message_counts.count("repaired.depth.unit")
        return replace(depth, depth_m=readonly(depth.depth_m * np.float32(self._factor), np.float32))

    def _measured(self, depth: DepthImage) -> float | None:
        """Factor that turns the values into metres; None if the image has too few readings."""
        values = depth.depth_m[np.isfinite(depth.depth_m) & (depth.depth_m > 0.0)]
        if len(values) < MIN_PIXELS:
            return None
        near, far = np.percentile(values, (NEAR_PERCENT, FAR_PERCENT)).tolist()
        factor = 1.0 / THOUSAND if near > MAX_NEAR_M else THOUSAND if far < MIN_FAR_M else 1.0
        if factor != 1.0:
            shown = near if factor < 1.0 else far
            self._message_counts.find(
                f"{self._label}: depths of {shown:.3g} m cannot be: multiplied by {factor:g}, the recorder's unit is another"
            )
        return factor
