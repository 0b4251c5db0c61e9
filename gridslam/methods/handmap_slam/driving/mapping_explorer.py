"""The explorer together with the mapper that estimates its pose, as `gridslam explore` runs it."""

from __future__ import annotations

from dataclasses import replace

from gridslam.methods.base import RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.driving.exploration_report import (
    exploration_measures,
    tour_picture,
    tour_table,
)
from gridslam.methods.handmap_slam.driving.explorer import Explorer
from gridslam.methods.handmap_slam.method import HandmapSlam
from gridslam.planning.dwa import DifferentialDrive, WheelSpeeds


class MappingExplorer:
    """An explorer that takes its poses from a mapper of the same drawing."""

    def __init__(
        self, mapper: HandmapSlam, config: HandmapSlamConfig, drive: DifferentialDrive, seed: int
    ) -> None:
        mapper.process_at_once()
        self._mapper = mapper
        self._explorer = Explorer(config.advanced.exploration, mapper.drawn, drive, seed)

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to observe."""
        return self._explorer.is_finished

    def add(self, event: object) -> None:
        """Process an event as it arrives."""
        self._explorer.add(event)

    def command(self) -> WheelSpeeds:
        """Wheel speeds for the next tenth of a second."""
        return self._explorer.command(self._mapper.estimate, self._mapper.drawing_pose)

    def add_to(self, result: RunResult) -> RunResult:
        """The mapper's result with the tour, the points that were not reached, and a picture."""
        plan = self._explorer.plan
        frontiers = self._explorer.frontiers
        measures = {
            **exploration_measures(plan),
            "frontiers": {"visited": frontiers.visited, "abandoned": frontiers.abandoned},
            "recoveries": self._explorer.recoveries,
        }
        tables = {**result.tables, **({"tour": tour_table(plan)} if plan else {})}
        pictures = dict(result.pictures)
        if "drawing" in pictures:
            rows, cols = self._mapper.drawn.walls.shape
            step = self._mapper.drawn.geometry.resolution_m
            pictures["exploration"] = tour_picture(plan, pictures["drawing"], (cols * step, rows * step))
        return replace(
            result, measures={**result.measures, "exploration": measures}, tables=tables, pictures=pictures
        )
