"""The drawing laid over a run's finished map, and its part of the run's result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.localizer import first_states
from gridslam.methods.handmap_slam.warp.comparison import DrawingComparison, compare
from gridslam.methods.handmap_slam.warp.results import (
    doubt_about,
    measures_of_warp,
    notes_about,
    poses_in_drawing,
    tables_of,
    warp_picture,
)
from gridslam.methods.handmap_slam.warp.warp import DrawingWarp, warp_of


@dataclass(frozen=True)
class LaidDrawing:
    """The warp, the comparison under it, and the robot's poses in the drawing at all scans."""

    drawn: DrawnMap
    warp: DrawingWarp
    comparison: DrawingComparison
    path: list[DrawingPose]

    @property
    def fits(self) -> bool:
        """Whether the drawing shows the place of the map."""
        return self.warp.fits

    def poses_at(self, rows: Sequence[int]) -> list[DrawingPose]:
        """The poses at some of the scans."""
        return [self.path[row] for row in rows]

    def add_to(self, result: RunResult) -> RunResult:
        """The result with tables, picture and measures of the warp; a drawing that does not fit makes the run `lost`."""
        drawing = result.measures.get("drawing")
        of_drawing = {
            **(drawing if isinstance(drawing, dict) else {}),
            "matches_place": self.fits,
            "warp": measures_of_warp(self.warp, self.comparison),
        }
        if self.fits:
            last = self.path[-1]
            of_drawing["final_pose"] = [round(v, 4) for v in (last.x, last.y, last.yaw_rad)]
        return replace(
            result,
            measures={**result.measures, "drawing": of_drawing},
            tables={**result.tables, **tables_of(self.warp, self.comparison, self.path)},
            pictures={
                **result.pictures,
                "warp": warp_picture(self.drawn, self.warp, self.comparison, self.path),
            },
            doubt=result.doubt or doubt_about(self.warp),
            notes=(*result.notes, *notes_about(self.warp)),
        )


def lay_over(
    drawn: DrawnMap,
    occupancy: OccupancyGrid,
    trajectory: Trajectory,
    config: HandmapSlamConfig,
    rng: np.random.Generator,
) -> LaidDrawing:
    """Lay a drawing over a map and a trajectory with at least one pose."""

    def first(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return first_states(config, drawn, points, rng)

    warp = warp_of(drawn, occupancy, poses=trajectory.poses, first=first, rng=rng)
    comparison = compare(drawn, warp)
    path = poses_in_drawing(warp, trajectory.stamps_ns.tolist(), trajectory.poses, comparison.place_agreement)
    return LaidDrawing(drawn, warp, comparison, path)
