"""Facts about one laser of a CARMEN log that only all of its lines together show."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field

import numpy as np

from gridslam.core.turned_pairs import TurnedPairs
from gridslam.logs.carmen.lines import LaserLine, beam_angles

DEFAULT_RANGE_MAX_M = 81.91  # the largest number a SICK LMS gives, its code for no return
# Numbers of beams of the lasers of these logs, 180 degrees wide
SICK_BEAMS = (90, 91, 180, 181, 360, 361, 720, 721)
MIN_BEAMS = 60  # a scan with fewer beams was thinned, and its number of beams says nothing about the laser
USUAL_WIDTHS_DEG, USUAL_STEPS_DEG = (180.0, 190.0, 240.0, 270.0), (0.25, 0.5, 1.0)
MIN_WIDTH_DEG = 90.0
_SAME_OFFSET = 1e-3  # m and rad: a larger difference between lines is not rounding, but a corrected pose
# If the largest reading makes up this fraction of all readings, it is not a distance but means "no return".
_MIN_PILED_FRACTION = 0.001
_MIN_PILED_READINGS = 10

Pose = tuple[float, float, float]


@dataclass(slots=True)
class LaserIndex:
    """Readings, beams and stamps of one kind of laser line, collected line by line.

    `stamps_ns` are those of all lines. `has_poses`: the lines have poses. `beams` is the number of beams of the first line that
    does not state its angles; 0 if all lines do.
    """

    stamps_ns: array[int] = field(default_factory=lambda: array("q"))
    has_poses: bool = True
    beams: int = 0
    _turned: TurnedPairs = field(default_factory=TurnedPairs)
    _readings: int = 0
    _largest_m: float = 0.0
    _at_largest: int = 0  # number of readings that are `_largest_m`
    _offset: Pose | None = None
    _offset_varies: bool = False

    def add(self, laser: LaserLine) -> None:
        """Add one line."""
        self.stamps_ns.append(laser.stamp_ns)
        self._add_readings(laser)
        if laser.geometry is None:
            self.beams = self.beams or len(laser.ranges)
            if laser.robot_pose is not None:
                self._turned.add(laser.robot_pose, laser.ranges)
        if not self._offset_varies:
            self._add_poses(laser)

    @property
    def range_max_m(self) -> float:
        """The reading that means "no return": the largest one if it is frequent, else that of a SICK."""
        is_piled = self._at_largest >= max(_MIN_PILED_READINGS, _MIN_PILED_FRACTION * self._readings)
        return self._largest_m if is_piled else DEFAULT_RANGE_MAX_M

    @property
    def T_robot_laser(self) -> Pose | None:  # noqa: N802
        """The pose of the laser on the robot (m, m, rad); None if the lines have no poses or contradict each other."""
        return None if self._offset_varies else self._offset

    @property
    def is_usual(self) -> bool:
        """Whether the number of beams is that of a SICK, or of a scan of which beams were removed."""
        return self.beams < MIN_BEAMS or self.beams in SICK_BEAMS

    def turned_width_deg(self) -> float | None:
        """The field of view (deg) with which scans before and after turns of the robot agree; None: 180 degrees may be right."""
        if self.beams < MIN_BEAMS:
            return None
        _, assumed = beam_angles(self.beams)
        intervals = self.beams - 1
        others = [math.radians(width) / intervals for width in _widths_deg(self.beams)]
        step = self._turned.better_step(self.beams, assumed, others)
        return None if step is None else math.degrees(step * intervals)

    def _add_readings(self, laser: LaserLine) -> None:
        """Count the readings, and those that are the largest."""
        self._readings += len(laser.ranges)
        largest = float(laser.ranges.max(initial=0.0))
        if not math.isfinite(largest):
            largest = float(np.max(laser.ranges, initial=0.0, where=np.isfinite(laser.ranges)))
        if largest > self._largest_m:
            self._largest_m, self._at_largest = largest, 0
        if largest == self._largest_m:
            self._at_largest += int(np.count_nonzero(laser.ranges == largest))

    def _add_poses(self, laser: LaserLine) -> None:
        """Compare the pose of the laser on the robot with that of earlier lines."""
        if laser.robot_pose is None:
            self.has_poses = False
            return
        offset = _offset(laser.robot_pose, laser.laser_pose)
        if self._offset is None:
            self._offset = offset
        elif max(abs(a - b) for a, b in zip(self._offset, offset, strict=True)) > _SAME_OFFSET:
            self._offset_varies = True


def _offset(robot: Pose, laser: Pose) -> Pose:
    """T_robot_laser, rounded to the six decimals that the lines have."""
    if robot == laser:
        return 0.0, 0.0, 0.0
    (rx, ry, robot_yaw), (lx, ly, laser_yaw) = robot, laser
    cos, sin = math.cos(robot_yaw), math.sin(robot_yaw)
    dx, dy = lx - rx, ly - ry
    yaw = math.remainder(laser_yaw - robot_yaw, 2.0 * math.pi)
    # Adding 0.0 turns -0.0 into 0.0.
    return (
        round(cos * dx + sin * dy, 6) + 0.0,
        round(cos * dy - sin * dx, 6) + 0.0,
        round(yaw, 6) + 0.0,
    )


def _widths_deg(beams: int) -> list[float]:
    """Usual angles (deg) from the first to the last of the beams: those of models, of whole circles, and of usual steps."""
    widths = [
        *USUAL_WIDTHS_DEG,
        360.0 * (beams - 1) / beams,
        *(step * (beams - 1) for step in USUAL_STEPS_DEG),
    ]
    return [width for width in widths if MIN_WIDTH_DEG <= width <= 360.0]
