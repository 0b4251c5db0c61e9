"""Prior of an object's pose before a visit: its last pose, and the places where doors can be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.walls import Walls

Floats = NDArray[np.float64]

HINGE_STD_M = 0.03  # standard deviation of a hinge from the plane of its wall
MIN_LOG_WALL = -50.0  # log prior of a hinge that lies in no wall
MAX_SQUARED_DISTANCE = 16.0  # Mahalanobis, of a hinge from an earlier estimate, which may have been wrong
MOVED_VOLUME = 40.0  # m^2 rad over which a moved box may be anywhere in the reader's range
MOVED_YAW = np.pi  # rad over which a door's leaf may have turned
DRAWING_RANGE = 1.2  # first poses are drawn up to this multiple of the antenna's range
IN_WALL_STD_M = 0.01  # standard deviation of drawn hinges from the plane of the wall


@dataclass(frozen=True, slots=True)
class PriorEstimate:
    """An earlier estimate: the pivot's pose (3,) and covariance `(3, 3)` in the frame of the visit.

    `is_certain`: the hinge is where the estimate says; otherwise the estimate may have been wrong altogether.
    """

    pose: Floats
    covariance: Floats
    is_certain: bool = False


@dataclass(frozen=True, slots=True)
class ObjectPosePrior:
    """The prior of an object's pose in one visit."""

    model: ObjectModel
    earlier: PriorEstimate | None
    walls: Walls
    settings: ObjectSettings

    def log_density(self, poses: Floats, wall_std_m: float, trust: float) -> Floats:
        """log P(pose) `(n,)` up to a constant: rarely moved since the earlier estimate; a door's hinge is in a wall.

        While the search narrows, `wall_std_m` widens the plane of the wall, and `trust` in [0, 1] tempers the belief that the
        object has not moved: otherwise no poses would be left elsewhere for the scans to weight.
        """
        out = np.zeros(len(poses))
        model, earlier = self.model, self.earlier
        if model.is_door and len(self.walls) and self.settings.objects.is_joint:
            std = max(HINGE_STD_M, wall_std_m)
            out += np.maximum(-0.5 * (self.walls.distances(poses[:, :2]) / std) ** 2, MIN_LOG_WALL)
        if earlier is None:
            return out
        offset = poses - earlier.pose
        offset[:, 2] = se2.wrap_angle(offset[:, 2])
        if model.is_door:
            hinge, yaw_variance = earlier.covariance[:2, :2], float(earlier.covariance[2, 2])
            squared = np.einsum("ni,ij,nj->n", offset[:, :2], np.linalg.inv(hinge), offset[:, :2])
            if earlier.is_certain:
                out -= 0.5 * squared
            else:
                out -= 0.5 * trust * np.minimum(squared, MAX_SQUARED_DISTANCE)
            unmoved = np.exp(-0.5 * offset[:, 2] ** 2 / yaw_variance)
            unmoved = unmoved * MOVED_YAW / np.sqrt(2.0 * np.pi * yaw_variance)
        else:
            squared = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(earlier.covariance), offset)
            volume = (2.0 * np.pi) ** 1.5 * np.sqrt(np.linalg.det(earlier.covariance))
            unmoved = np.exp(-0.5 * squared) * MOVED_VOLUME / volume
        move_probability = self.settings.evidence.move_probability
        return np.asarray(out + trust * np.log((1.0 - move_probability) * unmoved + move_probability))

    def draw(self, n: int, readers: Floats, rng: np.random.Generator) -> Floats:
        """First poses `(n, 3)` of the pivot, given the antenna poses `(r, 3)` that read a tag.

        Uniform over the detection area with the tag's normal facing the antenna, as the paper draws them. Unless
        `objects.estimation` is `paper`, half of a door's poses hinge in a wall, half of those flush with it, and some of the
        poses are about the earlier estimate.
        """
        model, earlier = self.model, self.earlier
        if len(readers):
            poses = self._in_detection_area(n, readers, rng)
        elif earlier is not None:
            poses = np.tile(earlier.pose, (n, 1))
            poses[:, 2] += np.pi * (2.0 * rng.random(n) - 1.0)
        else:
            raise ValueError("neither a read nor an earlier estimate: no pose can be drawn")
        if not self.settings.objects.is_joint:
            return poses
        if model.is_door and len(self.walls) and len(readers):
            poses[: n // 2] = _in_walls(model, poses[: n // 2], self.walls, rng)
        if earlier is not None:
            root = np.linalg.cholesky(earlier.covariance)
            about = earlier.pose + rng.standard_normal((n, 3)) @ root.T
            if model.is_door:
                hinged = slice(None) if earlier.is_certain else slice(None, None, 2)
                poses[hinged, :2] = about[hinged, :2]
                poses[::4, 2] = about[::4, 2]
            else:
                poses[::3] = about[::3]
        poses[:, 2] = se2.wrap_angle(poses[:, 2])
        return poses

    def _in_detection_area(self, n: int, readers: Floats, rng: np.random.Generator) -> Floats:
        """Poses `(n, 3)` uniform over the half disc before an antenna, a tag's normal facing it."""
        reader = readers[rng.integers(len(readers), size=n)]
        distance = DRAWING_RANGE * self.settings.objects.antenna.range_m * np.sqrt(rng.random(n))
        direction = reader[:, 2] + np.pi * (rng.random(n) - 0.5)
        facing = direction + np.pi * (1.5 + rng.random(n) - 1.0)
        tags = np.column_stack(
            [
                reader[:, 0] + distance * np.cos(direction),
                reader[:, 1] + distance * np.sin(direction),
                se2.wrap_angle(facing),
            ]
        )
        which = rng.integers(len(self.model.tags), size=n)
        return se2.compose(tags, se2.inverse(self.model.tags)[which])


def _in_walls(model: ObjectModel, poses: Floats, walls: Walls, rng: np.random.Generator) -> Floats:
    """The poses with their hinges moved into the nearest wall; every second leaf is flush with it."""
    tag = se2.compose(poses, model.tags[0])
    distance = walls.signed_distances(tag[:, :2])
    nearest = np.abs(distance).argmin(axis=1)
    direction = walls.directions[nearest]
    flush = np.where(np.cos(poses[:, 2] - direction) >= 0.0, direction, direction + np.pi)
    is_flush = np.arange(len(poses)) % 2 == 0
    yaw = np.where(is_flush, flush, poses[:, 2])
    rotated = np.column_stack([np.zeros((len(poses), 2)), yaw])
    lever = se2.compose(rotated, model.tags[0])[:, :2]
    hinge = np.where(is_flush[:, None], tag[:, :2] - lever, poses[:, :2])
    off = (hinge * walls.normals[nearest]).sum(axis=1) - walls.offsets[nearest]
    hinge = hinge - off[:, None] * walls.normals[nearest]
    return np.column_stack([hinge + IN_WALL_STD_M * rng.standard_normal(hinge.shape), se2.wrap_angle(yaw)])
