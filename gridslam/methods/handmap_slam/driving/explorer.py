"""Exploration: from the pose in the drawing and lidar observations to wheel speeds (paper sections 3 to 5).

`Explorer` does not depend on the simulator: it receives odometry and scans as they arrive, gives a command ten times a
second, and reports when it has finished.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.core.random import random_stream
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.base import Estimate
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.frontier_tour import FrontierTour
from gridslam.methods.handmap_slam.driving.observation_plan import (
    ARRIVAL_M,
    ObservationPlan,
    plan_observation,
)
from gridslam.methods.handmap_slam.driving.pathfinder import CostGrid, FoundPath, find_path, observed_costs
from gridslam.methods.handmap_slam.driving.plan_grid import PlanGrid, plan_grid
from gridslam.methods.handmap_slam.driving.pursuit import Pursuit
from gridslam.methods.handmap_slam.driving.recent_odometry import RecentOdometry
from gridslam.methods.handmap_slam.scan_memory import MAX_BEAM_M, BeamEndpoints, ScanMemory, beam_endpoints
from gridslam.planning.dwa import DifferentialDrive, WheelSpeeds
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

Floats = NDArray[np.float64]

NO_GOAL, FRONTIERS = -1, -2  # goals other than an observation point
PERIOD_S = 0.8  # time between two plans of the path
RESCALE_RATIO = 1.03  # change of a scale after which the planning grid is built again
# The path ends well inside the arrival distance, so that the robot does not stop short
GOAL_RADIUS_M = 0.5 * ARRIVAL_M
PROGRESS_M = 0.3  # smallest shortening of the path that counts as progress
BLOCKED_S = 10.0  # time without an open path after which an observation point is given up
PROGRESS_S = 45.0  # time without progress after which it is given up


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot at a stamp: T_odom_base, T_map_base (metric map), and its pose in the drawing."""

    stamp_ns: int
    T_odom_base: Floats
    T_map_base: Floats
    pose: DrawingPose


class Explorer:
    """Visits the observation points of a drawing one after another, then the frontiers of the observed space.

    It `is_finished` when all points are settled and no frontier is left.
    """

    def __init__(
        self, config: ExplorationConfig, drawn: DrawnMap, drive: DifferentialDrive, seed: int
    ) -> None:
        self._config = config
        self._drawn = drawn
        self._drive = drive
        self._rng = random_stream(seed, "handmap-slam.exploration")
        self._odometry = RecentOdometry()
        self._speeds = WheelSpeeds.standing()
        self._extrinsics: dict[str, LidarExtrinsics] = {}
        self._new_scans: list[BeamEndpoints] = []
        self._memory = ScanMemory()
        self._pursuit = Pursuit(config, drive)
        self.frontiers = FrontierTour(config)
        self._grid: PlanGrid | None = None
        self._planned_ns = 0
        self._settled = 0
        self._goal = NO_GOAL
        self._lowest_cost_m = np.inf
        self._progress_ns = 0
        self._open_ns = 0
        self.plan: ObservationPlan | None = None

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to observe."""
        is_tour_finished = self.plan is not None and not self.plan.tour
        return is_tour_finished and self.frontiers.is_finished

    @property
    def recoveries(self) -> int:
        """Number of times that the robot was stuck and recovered."""
        return self._pursuit.recoveries

    def add(self, event: object) -> None:
        """Process odometry, scans and extrinsics as they arrive."""
        if isinstance(event, Odometry):
            self._odometry.add(event)
            half = 0.5 * event.wz_radps * self._drive.base_m
            if np.isfinite(event.vx_mps) and np.isfinite(half):
                self._speeds = WheelSpeeds(event.vx_mps - half, event.vx_mps + half)
        elif isinstance(event, LaserScan) and len(self._odometry):
            extrinsics = self._extrinsics.get(event.frame_id, LidarExtrinsics(np.zeros(3)))
            scan = beam_endpoints(event, extrinsics, self._odometry.twist_at(event.stamp_ns), MAX_BEAM_M)
            self._new_scans.append(scan)
            self._pursuit.add_scan(self._odometry.pose_at(scan.stamp_ns), scan)
        elif isinstance(event, Transform) and event.is_static:
            self._extrinsics[event.child_frame_id] = extrinsics_of(event)

    def command(self, estimate: Estimate | None, pose: DrawingPose | None) -> WheelSpeeds:
        """Wheel speeds for the next period, given the estimator's last pose in the metric map and in the drawing."""
        if estimate is None or pose is None or not len(self._odometry):
            return WheelSpeeds.standing()
        now = self._state_now(estimate, pose)
        self._use_new_scans(estimate, now)
        if self.plan is None:
            self.plan = plan_observation(self._drawn, now.pose, self._drive.radius_m, self._config, self._rng)
        self._check_arrival(self.plan, now)
        goal = self.plan.tour[0] if self.plan.tour else FRONTIERS
        if goal != self._goal or now.stamp_ns - self._planned_ns >= PERIOD_S * 1e9:
            self._plan_path(self.plan, now)
        if self.is_finished:
            return WheelSpeeds.standing()
        return self._pursuit.command(now.stamp_ns, now.T_odom_base, self._speeds)

    def _state_now(self, estimate: Estimate, pose: DrawingPose) -> RobotState:
        """The estimator's poses, extrapolated to the present by odometry."""
        stamp, T_odom_base = self._odometry.latest
        step = se2.between(self._odometry.pose_at(estimate.stamp_ns), T_odom_base)
        drawing_step = se2.between(self._odometry.pose_at(pose.stamp_ns), T_odom_base)
        return RobotState(
            stamp, T_odom_base, se2.compose(estimate.pose, step), pose.after(drawing_step, stamp)
        )

    def _use_new_scans(self, estimate: Estimate, now: RobotState) -> None:
        """Add the new scans to the metric map, and mark the walls that the last one observes."""
        if not self._new_scans:
            return
        T_map_odom = se2.compose(estimate.pose, se2.inverse(self._odometry.pose_at(estimate.stamp_ns)))
        for scan in self._new_scans:
            T_odom_then = self._odometry.pose_at(scan.stamp_ns)
            T_map_then = se2.compose(T_map_odom, T_odom_then)
            self._memory.add(T_map_then, scan)
            self.frontiers.observed.add(T_map_then, scan)
        if self.plan is not None:
            step_back = se2.between(now.T_odom_base, T_odom_then)
            self.plan.add_scan(scan, now.pose.after(step_back), now.stamp_ns)
        self._new_scans.clear()

    def _check_arrival(self, plan: ObservationPlan, now: RobotState) -> None:
        """Settle the current point if the robot has arrived; plan the tour again if points were settled."""
        target = plan.current
        if target is not None:
            to_goal = now.pose.from_drawing(target.xy[None])[0]
            if float(np.hypot(*to_goal)) <= ARRIVAL_M:
                plan.settle(plan.tour[0], "reached", now.stamp_ns)
        if plan.settled != self._settled:
            self._settled = plan.settled
            plan.plan_tour_from(now.pose)

    def _plan_path(self, plan: ObservationPlan, now: RobotState) -> None:
        """Plan the path to the current point; give the point up if there has been no path or no progress for long."""
        self._planned_ns = now.stamp_ns
        if plan.current is None:
            self._goal = FRONTIERS
            found = self.frontiers.path(now.stamp_ns, now.T_map_base, self._drive.radius_m)
            self._pursuit.follow(found.path, now.T_odom_base)
            return
        if plan.tour[0] != self._goal:
            self._goal, self._lowest_cost_m = plan.tour[0], np.inf
            self._progress_ns = self._open_ns = now.stamp_ns
        found = self._path_to(plan.current.xy, now)
        self._pursuit.follow(found.path, now.T_odom_base)
        if np.isfinite(found.cost_m):
            self._open_ns = now.stamp_ns
        if found.cost_m < self._lowest_cost_m - PROGRESS_M:
            self._lowest_cost_m, self._progress_ns = found.cost_m, now.stamp_ns
        reason = self._reason_to_give_up(now, found)
        if reason:
            plan.give_up(reason, now.stamp_ns)
            self._goal = NO_GOAL

    def _path_to(self, goal_xy: Floats, now: RobotState) -> FoundPath:
        """The path over the drawing as corrected by the lidar."""
        grid = self._grid_at(now.pose)
        blocked, cleared = self._memory.cells_on(grid, now.T_map_base, now.pose)
        radius_m = self._drive.radius_m
        cell_cost = observed_costs(grid, blocked, cleared, radius_m, self._config)
        costs = CostGrid(grid, cell_cost, solid=blocked | (grid.walls & ~cleared))
        return find_path(costs, now.pose, goal_xy, radius_m, GOAL_RADIUS_M)

    def _reason_to_give_up(self, now: RobotState, found: FoundPath) -> str:
        if (now.stamp_ns - self._open_ns) * 1e-9 > BLOCKED_S:
            if found.is_goal_solid:
                return "the lidar sees an obstacle there"
            return "the lidar sees no open path"
        if (now.stamp_ns - self._progress_ns) * 1e-9 > PROGRESS_S:
            return f"the robot came no closer for {PROGRESS_S:g} s"
        return ""

    def _grid_at(self, pose: DrawingPose) -> PlanGrid:
        """The planning grid for the current scales."""
        if self._grid is not None:
            grid = self._grid
            scales = (pose.scale_x * grid.cell_m, pose.scale_y * grid.cell_m)
            ratios = [scale / size for scale, size in zip(scales, grid.cell_xy, strict=True)]
            if max(max(ratio, 1.0 / ratio) for ratio in ratios) < RESCALE_RATIO:
                return grid
        self._grid = plan_grid(self._drawn, pose.scale_x, pose.scale_y)
        return self._grid
