"""The likelihood field with visibility: a beam agrees with the map if it ends at a wall and no wall lies before its endpoint.

The likelihood field alone looks at endpoints only, and accepts a robot behind the wall that it observes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.localization.likelihood_field import BeamCells, VisibilityMap, sum_over_beams
from gridslam.sensors.grid_frame import poses_in_cells
from gridslam.sensors.likelihood_field import DistanceField, Table
from gridslam.sensors.range_caster import RangeCaster

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BeamSegments:
    """Beams in the robot's frame, perhaps of several scans: sensor positions `(m, 2)` and endpoints `(m, 2)`."""

    origins: Floats
    endpoints: Floats

    def __len__(self) -> int:
        return len(self.endpoints)

    def thinned(self, max_beams: int) -> BeamSegments:
        """At most this many of the beams, evenly."""
        n = len(self)
        chosen = np.arange(min(n, max_beams)) * n // max(min(n, max_beams), 1)
        return BeamSegments(self.origins[chosen], self.endpoints[chosen])


@dataclass(frozen=True, slots=True)
class VisibilityField:
    """A map as a distance field with ray casting.

    A beam is blocked by a wall more than `tolerance_m` before its endpoint, unless the beam becomes free when its endpoint is
    moved aside by `slack_m`: beams along a wall may graze it.
    """

    field: DistanceField
    caster: RangeCaster
    tolerance_m: float
    slack_m: float

    def table_sums(self, table: Table, beams: BeamSegments, poses: Floats) -> Floats:
        """Sums `(n,)` of the table's values under the endpoints for robot poses `(n, 3)`; blocked beams take the last value."""
        cell_m = self.field.geometry.resolution_m
        return np.asarray(
            sum_over_beams(
                VisibilityMap(
                    self.field.steps, self.caster.boxes, self.tolerance_m / cell_m, self.slack_m / cell_m
                ),
                table,
                BeamCells(np.ascontiguousarray(beams.origins) / cell_m, beams.endpoints / cell_m),
                poses_in_cells(self.field.geometry, poses),
            )
        )
