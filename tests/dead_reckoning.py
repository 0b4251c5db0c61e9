"""A method for tests: it trusts the odometry, marks the endpoints of beams, and can be slow or fail on request."""

from __future__ import annotations

import sys
import time
from types import MappingProxyType
from typing import Literal

import numpy as np
from pydantic import Field

from gridslam.config.base import StrictModel
from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods import registry
from gridslam.methods.base import Doubt, Estimate, RunResult, Series, Table
from gridslam.methods.registry import MethodEntry


class DeadReckoningConfig(StrictModel):
    """Settings of the test method."""

    name: Literal["dead-reckoning"] = "dead-reckoning"
    resolution_m: float = Field(0.1, gt=0.0)
    particles: int = Field(10, ge=1)
    sleep_s: float = Field(0.0, ge=0.0, description="per scan")
    announce: bool = Field(False, description="say so on stderr when the first scan arrives")
    fail: Literal["no", "method", "bug", "lost", "no-pose", "empty-map"] = "no"
    start: tuple[float, float, float] | None = None


class DeadReckoning:
    """Maps at the odometry's poses. The seed shifts a diagnostic, so that it affects the bytes of the result."""

    def __init__(
        self, config: DeadReckoningConfig, seed: int, occupancy: OccupancyGrid | None = None
    ) -> None:
        self.config = config
        self.noise = np.random.default_rng(seed)
        self.occupancy = occupancy
        self.pose = np.zeros(3)
        self.stamps: list[int] = []
        self.poses: list[np.ndarray] = []
        self.points: list[np.ndarray] = []

    @property
    def estimate(self) -> Estimate | None:
        return Estimate(self.stamps[-1], self.pose) if self.stamps else None

    def process(self, event: Event) -> None:
        if isinstance(event, Odometry):
            self.pose = event.pose
        elif isinstance(event, LaserScan):
            self._take_scan(event)

    def _take_scan(self, scan: LaserScan) -> None:
        if self.config.fail == "method":
            raise MethodError("the test method was asked to fail: set method.fail=no")
        if self.config.fail == "bug":
            raise ZeroDivisionError("a bug on purpose")
        if self.config.announce and not self.stamps:
            print("first scan", file=sys.stderr, flush=True)  # noqa: T201
        time.sleep(self.config.sleep_s)
        bearings = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
        good = np.isfinite(scan.ranges_m)
        ends = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)[good] * scan.ranges_m[good, None]
        self.stamps.append(scan.stamp_ns)
        self.poses.append(self.pose)
        self.points.append(se2.transform_points(self.pose, ends))

    def result(self) -> RunResult:
        if not self.stamps or self.config.fail == "no-pose":
            return RunResult(Trajectory.empty(), counters={"skipped.scan.too_short": len(self.stamps)})
        stamps = np.array(self.stamps, np.int64)
        deviation = self.noise.random(len(stamps))
        grid = self._grid() if self.occupancy is None else None
        return RunResult(
            Trajectory(stamps, np.array(self.poses)),
            occupancy=grid,
            layers={}
            if grid is None
            else {"hits": GridLayer(np.nan_to_num(grid.probability), grid.geometry)},
            tables={
                "deviation": Table(
                    ("stamp_ns", "deviation"), list(zip(self.stamps, deviation.tolist(), strict=True))
                )
            },
            series={"particle_std": Series(stamps, deviation, "m")},
            counters={"used.scan": len(stamps), "skipped.scan.too_short": 0},
            timings_s={"marking": 0.0},
            measures={"confidence": {"mean": float(deviation.mean())}},
            doubt=Doubt("lost", "the test method does not believe its poses")
            if self.config.fail == "lost"
            else None,
        )

    def _grid(self) -> OccupancyGrid:
        if self.config.fail == "empty-map":
            return OccupancyGrid(np.zeros((0, 0), np.float32), GridGeometry(0.1, (0.0, 0.0)))
        points = np.concatenate(self.points)
        step = self.config.resolution_m
        origin = np.floor(points.min(axis=0) / step) * step
        geometry = GridGeometry(step, (float(origin[0]), float(origin[1])))
        cells = geometry.cells(points)
        probability = np.full(tuple(cells.max(axis=0) + 1), 0.1, np.float32)
        probability[cells[:, 0], cells[:, 1]] = 0.9
        return OccupancyGrid(probability, geometry)


ENTRY = MethodEntry(
    config="tests.dead_reckoning:DeadReckoningConfig",
    mapper="tests.dead_reckoning:DeadReckoning",
    localizer="tests.dead_reckoning:DeadReckoning",
    needs=("scan", "odom"),
)


def register() -> MappingProxyType[str, MethodEntry]:
    """The registry with the test method."""
    return MappingProxyType({**registry.METHODS, "dead-reckoning": ENTRY})


def main() -> None:
    """The program with the test method registered."""
    from gridslam.cli import run

    registry.METHODS = register()
    run()
