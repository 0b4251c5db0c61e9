"""Sensors on joints that move, as a lidar on a pan unit, or on a robot that tilts: T_base_sensor at the stamp of each scan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan, Transform
from gridslam.logs import rotations
from gridslam.logs.placement.levelling import LevelBand, Tilt, level_scan, middle_ns, without_floor
from gridslam.logs.rotations import Quaternion, Rigid
from gridslam.logs.streams import RecordedStream, Source

MAX_JOINTS = 20  # largest number of joints on the chain from a sensor to the base


@dataclass(frozen=True, slots=True)
class Joint:
    """The poses of a moving frame in its parent's: `stamps_ns` int64 `(n,)`, ascending, and n poses."""

    stamps_ns: NDArray[np.int64]
    poses: Sequence[Rigid]

    def at(self, stamp_ns: int) -> Rigid:
        """The pose at a stamp, interpolated; the first or the last one outside of their time."""
        after = int(np.searchsorted(self.stamps_ns, stamp_ns, side="right"))
        if after == 0 or after == len(self.poses):
            return self.poses[min(after, len(self.poses) - 1)]
        before_ns, after_ns = int(self.stamps_ns[after - 1]), int(self.stamps_ns[after])
        fraction = (stamp_ns - before_ns) / max(after_ns - before_ns, 1)
        (p, q), (r, s) = self.poses[after - 1], self.poses[after]
        translation = tuple(a + fraction * (b - a) for a, b in zip(p, r, strict=True))
        sign = 1.0 if sum(a * b for a, b in zip(q, s, strict=True)) >= 0.0 else -1.0
        mixed = tuple(a + fraction * (sign * b - a) for a, b in zip(q, s, strict=True))
        return (translation[0], translation[1], translation[2]), _unit(mixed, q)


@dataclass(frozen=True, slots=True)
class MovingExtrinsics:
    """The chain from the base to a sensor, of fixed poses and joints, and the tilt of the base if scans are levelled.

    `is_upright`: the sensor's frame is level already, so that the tilt only shifts it.
    """

    base_frame: str
    links: Sequence[Rigid | Joint]
    tilt: Tilt | None = None
    is_upright: bool = False

    def placed(self, scan: LaserScan) -> tuple[Transform, LaserScan]:
        """T_base_sensor at the scan's stamp, the base made level, and the scan in a frame of its own."""
        pose = rotations.IDENTITY
        for link in self.links:
            pose = rotations.compose(pose, link.at(scan.stamp_ns) if isinstance(link, Joint) else link)
        if self.tilt is not None:
            band = LevelBand.of_lidar(pose[0][2])
            moved, turned = rotations.compose((rotations.IDENTITY[0], self.tilt.at(middle_ns(scan))), pose)
            pose = (moved, pose[1] if self.is_upright else turned)
            scan = scan if self.is_upright else level_scan(scan, pose, band)
        elif not self.is_upright:
            scan = without_floor(scan, pose)
        frame = f"{scan.frame_id}@{scan.stamp_ns}"
        transform = Transform(scan.stamp_ns, self.base_frame, frame, pose[0], pose[1], is_static=True)
        return transform, replace(scan, frame_id=frame)


def moving_extrinsics(
    source: Source, frames: Sequence[str], tree: Mapping[str, tuple[str, Rigid]], base_frame: str
) -> dict[str, MovingExtrinsics]:
    """The extrinsics of the frames that a moving transform connects with the base; `tree` has the fixed transforms."""
    moving = {s.child_frame: i for i, s in enumerate(source.streams) if _moves(s, tree, base_frame)}
    chains = {frame: chain for frame in frames if (chain := _chain(frame, tree, moving, source, base_frame))}
    wanted = frozenset(i for chain in chains.values() for i in chain if isinstance(i, int))
    if not wanted:
        return {}
    joints = _joints(source, wanted)
    return {
        frame: MovingExtrinsics(
            base_frame, [joints[link] if isinstance(link, int) else link for link in chain]
        )
        for frame, chain in chains.items()
        if all(link in joints for link in chain if isinstance(link, int))
    }


def _moves(stream: RecordedStream, tree: Mapping[str, tuple[str, Rigid]], base_frame: str) -> bool:
    is_joint = stream.kind == "tf" and stream.constant is None and stream.child_frame not in tree
    return is_joint and stream.child_frame != base_frame


def _chain(
    frame: str,
    tree: Mapping[str, tuple[str, Rigid]],
    moving: Mapping[str, int],
    source: Source,
    base_frame: str,
) -> list[int | Rigid]:
    """Fixed poses, and streams of moving ones, from the base to a frame; empty if no moving one lies in between."""
    chain: list[int | Rigid] = []
    while frame != base_frame and len(chain) < MAX_JOINTS:
        if frame in tree:
            frame, pose = tree[frame]
            chain.append(pose)
        elif frame in moving:
            chain.append(moving[frame])
            (frame,) = source.streams[moving[frame]].frames
        else:
            return []
    is_moving = any(isinstance(link, int) for link in chain)
    return chain[::-1] if frame == base_frame and is_moving else []


def _joints(source: Source, wanted: frozenset[int]) -> dict[int, Joint]:
    """The poses of the moving transforms, read in a pass of its own."""
    found: dict[int, list[tuple[int, Rigid]]] = {i: [] for i in wanted}
    schedule = [i for i in sorted(wanted) for _ in source.streams[i].stamps_ns]
    for index, event in source.read(wanted, schedule):
        if isinstance(event, Transform):
            rotation = rotations.normalise(event.quat_wxyz)
            if rotation is not None:
                found[index].append((event.stamp_ns, (event.translation_m, rotation)))
    joints = {}
    for index, values in found.items():
        values.sort(key=lambda value: value[0])
        if values:
            joints[index] = Joint(np.array([s for s, _ in values], np.int64), [pose for _, pose in values])
    return joints


def _unit(mixed: tuple[float, ...], otherwise: Quaternion) -> Quaternion:
    """The unit quaternion; `otherwise` where two opposite rotations were mixed."""
    w, x, y, z = mixed
    return rotations.normalise((w, x, y, z)) or otherwise
