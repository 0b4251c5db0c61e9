"""The error of a fixed camera's extrinsics, from the robot's own passes through its view.

While the robot is localized by its lidar, a camera should detect it where it is. A camera whose given extrinsics are a
little wrong detects it beside its place, always in the same manner. On the floor every small error of the six extrinsics
shows as a shift and a rotation about the camera: what a wrong pitch or roll does to points of about the same height is a shift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation

Floats = NDArray[np.float64]

SPACING_M = 0.3  # travel between detections that count: the errors of nearer ones are the same
MAX_PASSES = 200  # detections that are kept, the latest
MIN_PASSES = 8
# Standard deviation of a detection about the robot: its visible side changes, and the map's walls err
PASS_STD_M = 0.12
# What is known before: extrinsics are right to a decimetre and some degrees, and a camera detects the near side of the robot,
# whose centre lies farther away.
PRIOR_STD = np.array([0.1, 0.1, 0.07, 0.1])  # m, m, rad, m
NEAR_SIDE_M = 0.15
# Smallest chi2 of a correction: a right camera has more in one of a thousand cases (three degrees of freedom)
MIN_CHI2 = 16.3
# Off what the earlier detections say, by the median of the last MIN_PASSES: the camera was moved
MIN_MOVE_M = 0.25
MAX_OFF_M = 1.0  # largest distance of an object from the robot's pose if the robot may be seen there
ROUNDS = 5  # rounds of reweighting, by which a person beside the robot loses its weight


@dataclass(frozen=True, slots=True)
class Correction:
    """Planar correction `pose` `(3,)` (m, m, rad): it moves what the camera detects to where it is, in the map frame.

    `shift` `(3,)` is the same as shift and rotation of the camera at its place. `passes` is the number of detections of the robot
    that it is made of, `before_m` and `after_m` their median distance from the robot without and with it, the robot's near side
    taken into account.
    """

    pose: Floats
    shift: Floats
    passes: int
    before_m: float
    after_m: float


class RobotPasses:
    """Detections of the robot by a camera whose given extrinsics place it at `(2,)`, beside the robot's positions."""

    def __init__(self, place: Floats) -> None:
        self._place = place
        self._seen = np.zeros((0, 2))  # where the given extrinsics have the detections
        self._true = np.zeros((0, 2))
        self._moves = 0
        self.applied: Correction | None = None

    def add(self, seen: Floats, robot: Floats) -> Correction | None:
        """Add a detection `(2,)`, as corrected by now, of the robot at `(2,)`; returns a new correction, if there is one."""
        if len(self._true) and np.hypot(*(robot - self._true[-1])) < SPACING_M:
            return None
        if self.applied is not None:
            seen = se2.transform_points(se2.inverse(self.applied.pose), seen[None])[0]
        self._seen = np.concatenate([self._seen, seen[None]])[-MAX_PASSES:]
        self._true = np.concatenate([self._true, robot[None]])[-MAX_PASSES:]
        if len(self._seen) >= 2 * MIN_PASSES and self._is_moved():
            self._seen, self._true = self._seen[-MIN_PASSES:], self._true[-MIN_PASSES:]
            self._moves += 1
        if len(self._seen) >= MIN_PASSES:
            found = self._correction()
            if found is not None:
                self.applied = found
            return found
        return None

    def measures(self) -> dict[str, object] | None:
        """The correction for the report; None without one."""
        found = self.applied
        if found is None:
            return None
        return {
            "shift_m": [float(v) for v in found.shift[:2]],
            "yaw_deg": float(np.degrees(found.shift[2])),
            "passes": found.passes,
            "robot_off_before_m": found.before_m,
            "robot_off_after_m": found.after_m,
            "moves": self._moves,
        }

    def notes(self) -> list[str]:
        """Notes on the camera for the user, one line each."""
        moved = (
            ["was moved, as the robot's passes show; its extrinsics were estimated anew"]
            if self._moves
            else []
        )
        found = self.applied
        if found is None:
            return moved
        return [
            *moved,
            f"its extrinsics are off by {np.hypot(*found.shift[:2]):.2f} m and {np.degrees(found.shift[2]):+.1f} degrees and "
            f"were corrected: {found.passes} detections lie {found.before_m:.2f} m beside the robot, {found.after_m:.2f} m then",
        ]

    def _is_moved(self) -> bool:
        """Whether the last detections contradict those before."""
        jacobian, off = self._equations()
        found, _ = _solved(jacobian[:-MIN_PASSES], off[:-MIN_PASSES])
        recent = (off - jacobian @ found)[-MIN_PASSES:]
        return bool(np.hypot(*np.median(recent, axis=0)) > MIN_MOVE_M)

    def _correction(self) -> Correction | None:
        """The correction that the detections show; None as long as the given extrinsics may be right.

        Least squares over shift, rotation about the camera and depth of the near side, with Cauchy's weights.
        """
        jacobian, off = self._equations()
        found, information = _solved(jacobian, off)
        covariance = np.linalg.inv(information)[:3, :3]
        if found[:3] @ np.linalg.solve(covariance, found[:3]) < MIN_CHI2:
            return None
        before = off - jacobian[:, :, 3] * found[3]
        after = before - jacobian[:, :, :3] @ found[:3]
        medians = [float(np.median(np.hypot(*left.T))) for left in (before, after)]
        return Correction(about(self._place, found[:3]), found[:3], len(off), *medians)

    def _equations(self) -> tuple[Floats, Floats]:
        """Jacobian `(n, 2, 4)` of the detections' offsets by shift, rotation and side, and the offsets `(n, 2)` to the robot."""
        arm = self._seen - self._place
        jacobian = np.zeros((len(arm), 2, 4))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
        jacobian[:, :, 2] = np.column_stack([-arm[:, 1], arm[:, 0]])
        jacobian[:, :, 3] = arm / np.maximum(np.hypot(*arm.T), 1e-6)[:, None]
        return jacobian, self._true - self._seen


def lone_object_near(observation: CameraObservation, robot: Floats) -> Floats | None:
    """The centre `(2,)` of the moving object of a frame near to the robot's position `(2,)`; None if there is none, or more."""
    centres = [np.asarray(track.moving.centres.mean(axis=0)) for track in observation.tracks]
    near = [centre for centre in centres if np.hypot(*(centre - robot)) < MAX_OFF_M]
    return near[0] if len(near) == 1 else None


def _solved(jacobian: Floats, off: Floats) -> tuple[Floats, Floats]:
    """Parameters `(4,)` and their information `(4, 4)` for offsets `(n, 2)`, which the jacobian `(n, 2, 4)` predicts."""
    prior, expected = np.diag(PRIOR_STD**-2.0), np.array([0.0, 0.0, 0.0, NEAR_SIDE_M])
    found, information = expected, prior
    for _ in range(ROUNDS):
        squares = np.sum((off - jacobian @ found) ** 2, axis=1) / PASS_STD_M**2
        weights = 1.0 / (1.0 + squares) / PASS_STD_M**2
        information = prior + np.einsum("n,nki,nkj->ij", weights, jacobian, jacobian)
        found = np.linalg.solve(
            information, prior @ expected + np.einsum("n,nki,nk->i", weights, jacobian, off)
        )
    return found, information


def about(place: Floats, shift: Floats) -> Floats:
    """The pose `(3,)` that moves points by a shift and a rotation `(3,)` about a place `(2,)`."""
    x, y = place + shift[:2] - se2.transform_points([0.0, 0.0, shift[2]], place[None])[0]
    return np.array([x, y, shift[2]])
