"""Poses as a file or a topic states them, before they are reduced to the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.poses import wrap_angle, yaw_of_quaternion
from gridslam.core.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class PoseSeries:
    """Stamps `(n,)` (ns), positions `(n, 3)` (m), and the orientation as it was given.

    The orientation is either `quat_wxyz` `(n, 4)` or `yaw` `(n,)`, which is not wrapped; the other one is None. `name` is how
    messages call the series, `notes` says what was assumed when it was read. `has_stamps` is false for files without stamps;
    `stamps_ns` then counts the poses.
    """

    name: str
    stamps_ns: NDArray[np.int64]
    positions_m: NDArray[np.float64]
    quat_wxyz: NDArray[np.float64] | None = None
    yaw: NDArray[np.float64] | None = None
    has_stamps: bool = True
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @staticmethod
    def of(name: str, trajectory: Trajectory) -> PoseSeries:
        """The series of planar poses."""
        positions = np.column_stack([trajectory.poses[:, :2], np.zeros(len(trajectory))])
        return PoseSeries(name, trajectory.stamps_ns, positions, yaw=trajectory.poses[:, 2])

    @property
    def trajectory(self) -> Trajectory:
        """The poses in the plane: x, y and yaw."""
        if self.quat_wxyz is not None:
            yaw = yaw_of_quaternion(self.quat_wxyz)
        else:
            assert self.yaw is not None
            yaw = wrap_angle(self.yaw)
        return Trajectory(self.stamps_ns, np.column_stack([self.positions_m[:, :2], yaw]))
