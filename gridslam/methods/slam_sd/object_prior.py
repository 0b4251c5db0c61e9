"""What is known of an object's pose before a visit's evidence: where it stood, and where doors can be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.object_config import ObjectsConfig
from gridslam.methods.slam_sd.things import Thing
from gridslam.methods.slam_sd.walls import Walls

Floats = NDArray[np.float64]

FAR_FROM_WALL = -50.0  # log prior of a hinge that stands free
MOST_AWAY = 16.0  # squared Mahalanobis distance of a hinge: what was found before may have been wrong
SLAB_BOX = 40.0  # m^2 rad over which a moved box may be anywhere in the reader's range
SLAB_DOOR = np.pi  # rad over which a door's leaf may have turned


@dataclass(frozen=True, slots=True)
class Known:
    """An estimate of earlier: the pivot's pose (3,) with its covariance `(3, 3)`, in the frame of the visit.

    `is_firm`: the hinge is where it says; else the estimate may have been wrong altogether.
    """

    pose: Floats
    covariance: Floats
    is_firm: bool = False


def log_prior(
    thing: Thing,
    poses: Floats,
    known: Known | None,
    walls: Walls,
    sigma_m: float,
    trust: float,
    config: ObjectsConfig,
) -> Floats:
    """log P(pose) `(n,)` up to a constant: rarely moved since it was known; a door's hinge is in a wall and never moves.

    While the search narrows, `sigma_m` widens the plane of the wall, and `trust` in [0, 1] tempers the belief that the
    object has stayed: else the few poses about its old place would leave none elsewhere for the scans to weigh.
    """
    out = np.zeros(len(poses))
    if thing.is_door and len(walls) and config.doors_in_walls:
        deviation = max(config.hinge_sigma_m, sigma_m)
        out += np.maximum(-0.5 * (walls.distances(poses[:, :2]) / deviation) ** 2, FAR_FROM_WALL)
    if known is None:
        return out
    offset = poses - known.pose
    offset[:, 2] = se2.wrap_angle(offset[:, 2])
    if thing.is_door:
        hinge, turn = known.covariance[:2, :2], float(known.covariance[2, 2])
        away = np.einsum("ni,ij,nj->n", offset[:, :2], np.linalg.inv(hinge), offset[:, :2])
        out -= 0.5 * away if known.is_firm else 0.5 * trust * np.minimum(away, MOST_AWAY)
        spike = np.exp(-0.5 * offset[:, 2] ** 2 / turn) * SLAB_DOOR / np.sqrt(2.0 * np.pi * turn)
    else:
        square = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(known.covariance), offset)
        volume = (2.0 * np.pi) ** 1.5 * np.sqrt(np.linalg.det(known.covariance))
        spike = np.exp(-0.5 * square) * SLAB_BOX / volume
    stayed = 1.0 - config.move_probability
    return np.asarray(out + trust * np.log(stayed * spike + config.move_probability))


def draw(
    thing: Thing,
    n: int,
    readers: Floats,
    known: Known | None,
    walls: Walls,
    config: ObjectsConfig,
    rng: np.random.Generator,
) -> Floats:
    """Poses `(n, 3)` of the pivot to begin with, given the antenna poses `(r, 3)` that read a tag.

    Uniform over the detection area, the tag's normal facing the antenna, as the paper draws them. Unless `config.uniform`,
    half of the poses of a door hinge in a wall, half of those flush with it; and part of the poses are about the known one.
    """
    if len(readers):
        poses = _about_readers(thing, n, readers, config, rng)
    else:
        assert known is not None  # nothing read and nothing known: there is no filter
        poses = np.tile(known.pose, (n, 1))
        poses[:, 2] += np.pi * (2.0 * rng.random(n) - 1.0)
    if config.uniform:
        return poses
    if thing.is_door and len(walls) and len(readers):
        poses[: n // 2] = _in_walls(thing, poses[: n // 2], walls, rng)
    if known is not None:
        root = np.linalg.cholesky(known.covariance)
        about = known.pose + rng.standard_normal((n, 3)) @ root.T
        if thing.is_door:
            hinged = slice(None) if known.is_firm else slice(None, None, 2)
            poses[hinged, :2] = about[hinged, :2]
            poses[::4, 2] = about[::4, 2]
        else:
            poses[::3] = about[::3]
    poses[:, 2] = se2.wrap_angle(poses[:, 2])
    return poses


def _about_readers(
    thing: Thing, n: int, readers: Floats, config: ObjectsConfig, rng: np.random.Generator
) -> Floats:
    reader = readers[rng.integers(len(readers), size=n)]
    distance = 1.2 * config.antenna.range_m * np.sqrt(rng.random(n))
    direction = reader[:, 2] + np.pi * (rng.random(n) - 0.5)
    facing = direction + np.pi * (1.5 + rng.random(n) - 1.0)
    tags = np.column_stack(
        [
            reader[:, 0] + distance * np.cos(direction),
            reader[:, 1] + distance * np.sin(direction),
            se2.wrap_angle(facing),
        ]
    )
    which = rng.integers(len(thing.tags), size=n)
    return se2.compose(tags, se2.inverse(thing.tags)[which])


def _in_walls(thing: Thing, poses: Floats, walls: Walls, rng: np.random.Generator) -> Floats:
    """The poses with their hinges moved into the nearest wall, every second leaf turned to be flush with it."""
    tag = se2.compose(poses, thing.tags[0])
    distance = walls.signed_distances(tag[:, :2])
    nearest = np.abs(distance).argmin(axis=1)
    line = walls.directions[nearest]
    flush = np.where(np.cos(poses[:, 2] - line) >= 0.0, line, line + np.pi)
    is_flush = np.arange(len(poses)) % 2 == 0
    yaw = np.where(is_flush, flush, poses[:, 2])
    moved = np.column_stack([np.zeros((len(poses), 2)), yaw])
    arm = se2.compose(moved, thing.tags[0])[:, :2]
    hinge = np.where(is_flush[:, None], tag[:, :2] - arm, poses[:, :2])
    off = (hinge * walls.normals[nearest]).sum(axis=1) - walls.offsets[nearest]
    hinge = hinge - off[:, None] * walls.normals[nearest]
    return np.column_stack([hinge + 0.01 * rng.standard_normal(hinge.shape), se2.wrap_angle(yaw)])
