"""Where to drive next: from a drawing pose and what the lidar sees to wheel speeds (paper sections 3 to 5).

`Explorer` knows no simulator: it is shown odometry and scans as they come, asked for a command many times a second, and says
when it is done.
"""

from __future__ import annotations

import bisect
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.core.random import random_stream
from gridslam.core.trajectory import pose_at
from gridslam.maps.drawing import DrawnMap
from gridslam.methods.base import Estimate, RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.explorer_outcome import exploration_measures, tour_picture, tour_table
from gridslam.methods.handmap_slam.frontier import FrontierTour
from gridslam.methods.handmap_slam.line_front_end import moved
from gridslam.methods.handmap_slam.method import HandmapSlam
from gridslam.methods.handmap_slam.observation_plan import ObservationPlan, plan_observation
from gridslam.methods.handmap_slam.pathfinder import FoundPath, find_path, passable_prices
from gridslam.methods.handmap_slam.plan_grid import PlanGrid, plan_grid
from gridslam.methods.handmap_slam.planning_config import ExplorationConfig
from gridslam.methods.handmap_slam.pursuit import Command, Pursuit
from gridslam.methods.handmap_slam.seen_scans import ScanMemory, SeenScan, seen_scan
from gridslam.planning.dwa import Drive
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

Floats = NDArray[np.float64]

ODOMETRY_KEPT = 200
BEYOND = -2  # the goal when the tour is done
RESCALE = 1.03  # the planning grid is made again when a scale has changed by more
MOST_TWIST_S = 0.5
GOAL_SHARE = 0.5  # of the arrival distance: the path ends well inside, so that the robot does not stop short


@dataclass(frozen=True, slots=True)
class Situation:
    """The robot now: stamp, T_odom_base, T_map_base (metric map), and its pose in the drawing."""

    stamp_ns: int
    T_odom_base: Floats
    T_map_base: Floats
    pose: DrawingPose


class Explorer:
    """Visits the observation points of a drawing one after the other, then what the drawing lacks.

    `is_finished` when all points are settled and no border to unseen space is left.
    """

    def __init__(self, config: ExplorationConfig, drawn: DrawnMap, drive: Drive, seed: int) -> None:
        self._config = config
        self._drawn = drawn
        self._drive = drive
        self._rng = random_stream(seed, "handmap-slam.exploration")
        self._odometry: deque[tuple[int, Floats]] = deque(maxlen=ODOMETRY_KEPT)
        self._speeds = (0.0, 0.0)
        self._sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self._waiting: list[SeenScan] = []
        self._memory = ScanMemory(config.path)
        self._pursuit = Pursuit(config, drive)
        self.frontiers = FrontierTour(config.path, config.frontier)
        self._grid: PlanGrid | None = None
        self._planned_ns = 0
        self._settled = 0
        self._goal = -1
        self._least_cost_m = np.inf
        self._nearer_ns = 0
        self._open_ns = 0
        self.plan: ObservationPlan | None = None

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to look at."""
        return self._is_tour_done and self.frontiers.is_finished

    @property
    def _is_tour_done(self) -> bool:
        return self.plan is not None and not self.plan.tour

    @property
    def recoveries(self) -> int:
        """How often the robot had to free itself."""
        return self._pursuit.recoveries

    def see(self, event: object) -> None:
        """Take in odometry, scans and sensor_extrinsics, as they come."""
        if isinstance(event, Odometry):
            self._odometry.append((event.stamp_ns, event.pose))
            half = 0.5 * event.wz_radps * self._drive.base_m
            if np.isfinite(event.vx_mps) and np.isfinite(half):
                self._speeds = (event.vx_mps - half, event.vx_mps + half)
        elif isinstance(event, LaserScan) and self._odometry:
            extrinsics = self._sensor_extrinsics.get(event.frame_id, LidarExtrinsics(np.zeros(3)))
            scan = seen_scan(event, extrinsics, self._twist_at(event.stamp_ns), self._config.path.sight_m)
            self._waiting.append(scan)
            self._pursuit.see(self._odometry_at(scan.stamp_ns), scan)
        elif isinstance(event, Transform) and event.is_static:
            self._sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)

    def command(self, estimate: Estimate | None, pose: DrawingPose | None) -> Command:
        """Wheel speeds for the next moment, from the estimator's last pose in the metric map and in the drawing."""
        if estimate is None or pose is None or not self._odometry:
            return Command.stand()
        now = self._situation(estimate, pose)
        self._remember(estimate, now)
        if self.plan is None:
            self.plan = plan_observation(self._drawn, now.pose, self._drive.radius_m, self._config, self._rng)
        self._check_arrival(now)
        if self._is_time_to_plan(now):
            self._find_way(now)
        if self.is_finished:
            return Command.stand()
        return self._pursuit.command(now.stamp_ns, now.T_odom_base, self._speeds)

    def _situation(self, estimate: Estimate, pose: DrawingPose) -> Situation:
        """The estimator's poses carried on to the present by odometry."""
        stamp, T_odom_base = self._odometry[-1]
        since = se2.between(self._odometry_at(estimate.stamp_ns), T_odom_base)
        drawn_since = se2.between(self._odometry_at(pose.stamp_ns), T_odom_base)
        return Situation(
            stamp, T_odom_base, se2.compose(estimate.pose, since), moved(pose, drawn_since, stamp)
        )

    def _remember(self, estimate: Estimate, now: Situation) -> None:
        """Put new scans into the metric map, and note which walls they have looked at."""
        if not self._waiting:
            return
        T_map_odom = se2.compose(estimate.pose, se2.inverse(self._odometry_at(estimate.stamp_ns)))
        for scan in self._waiting:
            T_odom_then = self._odometry_at(scan.stamp_ns)
            T_map_then = se2.compose(T_map_odom, T_odom_then)
            self._memory.add(T_map_then, scan)
            self.frontiers.seen.add(T_map_then, scan)
        if self.plan is not None:
            back = se2.between(now.T_odom_base, T_odom_then)
            self.plan.look(scan, moved(now.pose, back), now.stamp_ns)
        self._waiting.clear()

    def _check_arrival(self, now: Situation) -> None:
        """Settle the current point when the robot is there; plan the tour anew when points were settled on the way."""
        plan = self.plan
        assert plan is not None
        target = plan.current
        if target is not None:
            to_goal = now.pose.from_drawing(target.xy[None])[0]
            if float(np.hypot(*to_goal)) <= self._config.observation.arrival_m:
                plan.settle(plan.tour[0], "reached", now.stamp_ns)
        if plan.settled != self._settled:
            self._settled = plan.settled
            plan.order_from(now.pose)

    def _is_time_to_plan(self, now: Situation) -> bool:
        assert self.plan is not None
        period_ns = self._config.path.period_s * 1e9
        goal = self.plan.tour[0] if self.plan.tour else BEYOND
        return goal != self._goal or now.stamp_ns - self._planned_ns >= period_ns

    def _find_way(self, now: Situation) -> None:
        """Find the path to the current point anew; give the point up when there is none, or no progress, for long."""
        plan = self.plan
        assert plan is not None
        if plan.current is None:
            self._goal, self._planned_ns = BEYOND, now.stamp_ns
            found = self.frontiers.way(now.stamp_ns, now.T_map_base, self._drive.radius_m)
            self._pursuit.follow(found.way, now.T_odom_base)
            return
        if plan.tour[0] != self._goal:
            self._goal, self._least_cost_m = plan.tour[0], np.inf
            self._nearer_ns = self._open_ns = now.stamp_ns
        self._planned_ns = now.stamp_ns
        found = self._path(now, plan.current.xy)
        self._pursuit.follow(found.way, now.T_odom_base)
        if np.isfinite(found.cost_m):
            self._open_ns = now.stamp_ns
        if found.cost_m < self._least_cost_m - self._config.patience.progress_m:
            self._least_cost_m, self._nearer_ns = found.cost_m, now.stamp_ns
        reason = self._reason_to_give_up(now, found)
        if reason:
            plan.give_up(reason, now.stamp_ns)
            self._goal = -1

    def _path(self, now: Situation, goal_xy: Floats) -> FoundPath:
        """The path over the drawing as the lidar corrects it."""
        path, pose = self._config.path, now.pose
        grid = self._grid_at(pose)
        blocked, cleared = self._memory.over(grid, now.T_map_base, pose)
        price = passable_prices(grid, blocked, cleared, self._drive.radius_m, path)
        solid = blocked | (grid.walls & ~cleared)
        arrival = self._config.observation.arrival_m
        return find_path(grid, price, solid, pose, goal_xy, self._drive.radius_m, GOAL_SHARE * arrival)

    def _reason_to_give_up(self, now: Situation, found: FoundPath) -> str:
        patience = self._config.patience
        if (now.stamp_ns - self._open_ns) * 1e-9 > patience.blocked_s:
            if found.is_walled:
                return "the place is solid, by what the lidar sees"
            return "every way is closed, by what the lidar sees"
        if (now.stamp_ns - self._nearer_ns) * 1e-9 > patience.progress_s:
            return f"the robot came no nearer for {patience.progress_s:g} s"
        return ""

    def _grid_at(self, pose: DrawingPose) -> PlanGrid:
        """The planning grid for the present scales."""
        cell_m = self._config.path.cell_m
        if self._grid is not None:
            grid = self._grid
            scales = (pose.scale_x * grid.cell_m, pose.scale_y * grid.cell_m)
            ratios = [scale / size for scale, size in zip(scales, grid.cell_xy, strict=True)]
            if max(max(r, 1.0 / r) for r in ratios) < RESCALE:
                return grid
        self._grid = plan_grid(self._drawn, pose.scale_x, pose.scale_y, cell_m)
        return self._grid

    def _odometry_at(self, stamp_ns: int) -> Floats:
        """T_odom_base at a stamp, between the two nearest; beyond what is kept, the nearest."""
        stamps = [stamp for stamp, _ in self._odometry]
        inside_ns = min(max(stamp_ns, stamps[0]), stamps[-1])
        pose = pose_at(inside_ns, stamps, [pose for _, pose in self._odometry])
        assert pose is not None  # the stamp is among those kept
        return pose

    def _twist_at(self, stamp_ns: int) -> Floats:
        """Velocity (vx, vy, wz) by odometry about a stamp."""
        if len(self._odometry) < 2:
            return np.zeros(3)
        stamps = [stamp for stamp, _ in self._odometry]
        after = min(max(bisect.bisect_left(stamps, stamp_ns), 1), len(stamps) - 1)
        (t0, a), (t1, b) = self._odometry[after - 1], self._odometry[after]
        elapsed = (t1 - t0) * 1e-9
        return se2.between(a, b) / elapsed if 0.0 < elapsed < MOST_TWIST_S else np.zeros(3)


class MappingExplorer:
    """An explorer that listens to the mapper of the same drawing."""

    def __init__(self, mapper: HandmapSlam, config: HandmapSlamConfig, drive: Drive, seed: int) -> None:
        self._mapper = mapper
        self._explorer = Explorer(config.exploration, mapper.drawn, drive, seed)

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to look at."""
        return self._explorer.is_finished

    def see(self, event: object) -> None:
        """Take in an event as it comes."""
        self._explorer.see(event)

    def command(self) -> Command:
        """Wheel speeds for the next tenth of a second."""
        return self._explorer.command(self._mapper.estimate, self._mapper.drawing_pose)

    def told(self, result: RunResult) -> RunResult:
        """The mapper's result with the tour, what of it was not reached, and the picture of it all."""
        plan = self._explorer.plan
        frontiers = self._explorer.frontiers
        measures = {
            **exploration_measures(plan),
            "borders": {"seen_through": frontiers.visited, "given_up": frontiers.given_up},
            "recoveries": self._explorer.recoveries,
        }
        tables = {**result.tables, **({"tour": tour_table(plan)} if plan else {})}
        pictures = dict(result.pictures)
        if "drawing" in pictures:
            rows, cols = self._mapper.drawn.walls.shape
            step = self._mapper.drawn.geometry.resolution_m
            size = (cols * step, rows * step)
            pictures["exploration"] = tour_picture(plan, pictures["drawing"], size)
        return replace(
            result, measures={**result.measures, "exploration": measures}, tables=tables, pictures=pictures
        )
