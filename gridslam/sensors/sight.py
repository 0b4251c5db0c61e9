"""Beams as lines of sight: explained by a map when they end at a wall and nothing is in their way.

The likelihood field alone looks at end points only, and is content with a robot behind the wall that it sees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.likelihood_field import sum_over_segments
from gridslam.sensors.grid_frame import poses_in_cells
from gridslam.sensors.likelihood_field import DistanceField, Table
from gridslam.sensors.range_caster import RangeCaster

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Segments:
    """Lines of sight in the robot's frame: where the sensor was `(m, 2)`, and where the beams ended `(m, 2)`."""

    starts: Floats
    ends: Floats

    def __len__(self) -> int:
        return len(self.ends)


@dataclass(frozen=True, slots=True)
class Sight:
    """A map as lines of sight meet it; a wall within `tolerance_m` before the end is the end.

    Lines are `slack_m` wide at their ends: what grazes a wall is not blocked by it.
    """

    field: DistanceField
    caster: RangeCaster
    tolerance_m: float
    slack_m: float

    def sums(self, table: Table, segments: Segments, poses: Floats) -> Floats:
        """Sum of the table's values `(n,)` at the ends, seen from poses `(n, 3)`; blocked lines take the table's last value."""
        step = self.field.geometry.resolution_m
        return np.asarray(
            sum_over_segments(
                self.field.steps,
                self.caster.squares,
                table,
                np.ascontiguousarray(segments.starts) / step,
                segments.ends / step,
                self.tolerance_m / step,
                self.slack_m / step,
                poses_in_cells(self.field.geometry, poses),
            )
        )
