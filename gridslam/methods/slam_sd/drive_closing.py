"""The end of a drive: loops closed, session continued, consistency assessed, map drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.grid_map import draw_map
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.loop_closure.trajectory import ClosedTrajectory, close_trajectory
from gridslam.lidar_slam.map_consistency.assessment import MapConsistency, assess_map
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.sessions.continuation import Continued, continue_session
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.lidar_slam.sessions.session import Session
from gridslam.lidar_slam.sessions.session_map import SessionMap, draw_session
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.objects.object_layer import ObjectLayer
from gridslam.methods.slam_sd.objects.object_result import ObjectResult
from gridslam.methods.slam_sd.session_result import (
    SessionFile,
    constraints_of,
    drive_of,
    refuse_repeated_log,
    scans_to_compare,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ClosedDrive:
    """Final poses `(k, 3)` of the key scans, the loops between them, the session, and how it was continued, if it was."""

    poses: Floats
    loops: Edges
    session: Session | None = None
    continued: Continued | None = None
    measures: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class DriveClosing:
    """The end of a drive: its tracked scans, its objects, and the session that it continues, if there is one."""

    config: SlamSdConfig
    tracker: ScanTracker
    objects: ObjectLayer
    stopwatch: Stopwatch
    session: Session | None
    log_name: str

    def closed(self, poses: Floats) -> ClosedDrive:
        """The drive from poses `(k, 3)` of its key scans, with its loops closed, unless that is disabled, and its session."""
        if not self.config.pose_graph.enabled:
            return ClosedDrive(poses, Edges.none())
        with self.stopwatch.stage("loop_closure"):
            closed, measures = self._optimised(poses)
            session, continued = self._session_with(closed)
            poses = closed.poses if continued is None else session.poses_of(len(session.drives) - 1)
        return ClosedDrive(poses, closed.loops, session, continued, {"pose_graph": measures})

    def assessed(self, drive: ClosedDrive) -> MapConsistency:
        """Consistency of the map of this drive, or of that of all drives of its session."""
        with self.stopwatch.stage("map_consistency"):
            if drive.continued is not None:
                return assess_map(*scans_to_compare(drive.continued.session), self._drift)
            tracker = self.tracker
            return assess_map(
                tracker.key_scans, drive.poses, tracker.path.key_poses, drive.loops, self._track_drift
            )

    def drawn(
        self, drive: ClosedDrive, trajectory: Trajectory
    ) -> tuple[OccupancyGrid, SessionMap | None, ObjectResult | None]:
        """The map, what else is drawn of a session that goes on, and the objects."""
        config, tracker = self.config, self.tracker
        resolution_m = config.map.resolution_m
        if config.pose_graph.enabled:
            resolution_m = config.pose_graph.resolution_m or resolution_m
        path, drawn = drive.poses, None
        with self.stopwatch.stage("draw_map"):
            if drive.continued is not None:
                drawn = draw_session(drive.continued.session, resolution_m, config.memory_limit_mb)
                static = drawn.grid
                if drive.continued.is_joined:
                    path = drive.continued.session.poses
            else:
                masked = self.objects.returns_on_objects(tracker.key_scans, drive.poses)
                static = draw_map(
                    tracker.key_scans, drive.poses, resolution_m, config.memory_limit_mb, masked
                )
            return static, drawn, self.objects.result(static, path, trajectory)

    def session_file(self, drive: ClosedDrive, drawn: SessionMap | None = None) -> SessionFile | None:
        """The file of the drive's session, with what was drawn of it; None without a session."""
        if drive.session is None:
            return None
        with self.stopwatch.stage("session"):
            session = drive.session if drawn is None else replace(drive.session, drawn=drawn.drawn)
            return SessionFile.of(session)

    @property
    def _drift(self) -> DriftModel:
        return DriftModel.of(self.config.advanced.loop_closure)

    @property
    def _track_drift(self) -> DriftModel:
        """The drift of this drive's track, with what it may have slipped without odometry."""
        return replace(self._drift, slips=self.tracker.path.key_slips)

    def _optimised(self, key_poses: Floats) -> tuple[ClosedTrajectory, dict[str, object]]:
        """The key scans after loop closure, given their poses `(k, 3)`, and its measures; moved objects give no constraint."""
        closed = close_trajectory(
            self.objects.all_without_moved_objects(self.tracker.key_scans, key_poses),
            self.tracker.path.key_poses,
            self.objects.landmarks(key_poses),
            self._track_drift,
        )
        self.objects.update_history(closed.poses)
        moved_m = np.hypot(*(closed.poses - key_poses)[:, :2].T)
        largest = {"largest_correction_m": round(float(moved_m.max()), 4)}
        return closed, {**closed.measures, **largest}

    def _session_with(self, closed: ClosedTrajectory) -> tuple[Session, Continued | None]:
        """The session after this drive; and if it continues an earlier one, how."""
        tracker = self.tracker
        scans = self.objects.all_without_objects(tracker.key_scans, closed.poses)
        drive = drive_of(self.log_name, tracker, scans)
        constraints = constraints_of(closed, self.objects.landmarks(closed.poses))
        if self.session is None:
            objects = self.objects.records(ObjectRecords.none())
            return Session((drive,), closed.poses, np.zeros(1, np.int64), constraints, objects), None
        refuse_repeated_log(self.session, drive)
        continued = continue_session(self.session, drive, closed.poses, constraints, self._drift)
        session = continued.session
        earlier, first_key = session.objects, int(session.first_key[-2])
        if continued.is_joined:
            self.objects.continue_histories(earlier, first_key, session.poses)
            objects = self.objects.records(earlier)
        else:
            own = self.objects.records(ObjectRecords.none())
            own = replace(own, anchor=own.anchor + first_key)
            objects = ObjectRecords.concatenate([earlier, own])
        session = replace(session, objects=objects)
        return session, replace(continued, session=session)
