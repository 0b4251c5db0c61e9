"""Repairs of the scans of a log once their faults are known: returns of the robot itself, angles, times, sense."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from gridslam.core.messages import Event, LaserScan, Transform, as_float32
from gridslam.core.stamps import earlier_stamp
from gridslam.lidar_slam.sensor_checks.floor_line import FloorLine
from gridslam.lidar_slam.sensor_checks.level_check import LevelledScans
from gridslam.lidar_slam.sensor_checks.lidar_agreement import LidarFault, mirrored
from gridslam.lidar_slam.sensor_checks.own_body import OwnBody
from gridslam.lidar_slam.sensor_checks.scan_angles import ScanAngles
from gridslam.lidar_slam.sensor_checks.sweep_calibration import SweepTime


@dataclass(slots=True)
class ScanRepairs:
    """The repairs of all scans; none at first.

    `reverses_scans`: scans that contradict themselves about the direction of their angles are reversed. `is_upside_down`: the
    only lidar hangs upside down, against its extrinsics. `sweep`: duration of a sweep if the messages state none, or a wrong
    one. `late_scans_s`: duration of the sweep if scans are stamped at its end, else 0. `lidars`: faults of single lidars.
    """

    levels: LevelledScans = field(default_factory=lambda: LevelledScans({}))
    own_bodies: list[OwnBody] = field(default_factory=list)
    floor_lines: list[FloorLine] = field(default_factory=list)
    angles: list[ScanAngles] = field(default_factory=list)
    lidars: Sequence[LidarFault] = ()
    reverses_scans: bool = False
    is_upside_down: bool = False
    sweep: SweepTime | None = None
    late_scans_s: float = 0.0

    def applied_to(self, event: Event) -> Event:
        """The repaired scan or lidar transform; other events unchanged."""
        event = self.levels.applied_to(event)
        if isinstance(event, Transform):
            for line in self.floor_lines:
                event = line.applied_to_transform(event)
            for fault in self.lidars:
                event = fault.applied_to_transform(event)
        if not isinstance(event, LaserScan):
            return event
        for body in self.own_bodies:
            event = body.removed_from(event)
        for line in self.floor_lines:
            event = line.removed_from(event)
        for angles in self.angles:
            event = angles.applied_to(event)
        for fault in self.lidars:
            event = fault.applied_to(event)
        if self.sweep is not None:
            event = self.sweep.applied_to(event)
        if self.late_scans_s:
            event = replace(event, stamp_ns=earlier_stamp(event.stamp_ns, self.late_scans_s))
        if self.is_upside_down:
            event = mirrored(event)
        return reversed_sense(event) if self.reverses_scans and event.has_uncertain_sense else event

    @property
    def notes(self) -> list[str]:
        """One line for each kind of repair but for bodies."""
        found = [] if self.levels.note is None else [self.levels.note]
        found += [line.note for line in self.floor_lines]
        found += [angles.note for angles in self.angles]
        found += [fault.note for fault in self.lidars]
        if self.reverses_scans:
            found.append(
                "the scans contradict themselves about the direction of their angles: that of the odometry is used"
            )
        if self.is_upside_down:
            found.append(
                "the lidar hangs upside down, by the rotations of odometry and IMU, but not by its extrinsics: its scans are "
                "mirrored; set log.extrinsics with roll: 3.1416"
            )
        if self.sweep is not None:
            found.append(self.sweep.note)
        if self.late_scans_s:
            found.append(
                f"by the odometry the scans are stamped at the end of their sweep, {self.late_scans_s:.3f} s after the first "
                "beam: their stamps, and those of the poses, are moved"
            )
        return found


def reversed_sense(scan: LaserScan) -> LaserScan:
    """The scan with the same readings, the first one at the angle of the last."""
    last_rad = scan.angle_min_rad + scan.angle_increment_rad * (len(scan.ranges_m) - 1)
    return replace(
        scan, angle_min_rad=as_float32(last_rad), angle_increment_rad=as_float32(-scan.angle_increment_rad)
    )
