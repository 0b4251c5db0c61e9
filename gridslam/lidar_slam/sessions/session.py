"""A session: the drives through a place with their key scans, poses and the pose graph that holds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import offsets_of
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.key_scans import distribute_corrections
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.drawn_state import DrawnState
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.lidar_slam.sway import without_swing

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Drive:
    """One recorded drive: the name of its log, stamps `(n,)` and front end's poses `(n, 3)` of all its scans.

    `keys` `(k,)` are the rows of the key scans `scans`. `range_m` is how far the lidar saw, but for a few beams. `swing_m`
    `(n, 2)` are the shifts of the lidar of a robot that sways, in the robot's frame at each scan; None where it does not.
    """

    log: str
    stamps_ns: Ints
    track: Floats
    keys: Ints
    scans: Sequence[PreparedScan]
    range_m: float = 0.0
    swing_m: Floats | None = None

    @property
    def key_track(self) -> Floats:
        """The front end's poses `(k, 3)` of the key scans."""
        return np.asarray(self.track[self.keys])

    def corrected(self, key_poses: Floats) -> Trajectory:
        """The path over all scans, given the final poses `(k, 3)` of the key scans; without the robot's sway."""
        poses = distribute_corrections(self.track, self.keys, key_poses)
        return Trajectory(
            self.stamps_ns, poses if self.swing_m is None else without_swing(poses, self.swing_m)
        )


@dataclass(frozen=True, slots=True)
class Constraints:
    """Edges of a pose graph between key scans, beside the front end's motions.

    `loops` closed the loops, `visits` register later visits of a place in earlier ones, `landmarks` are objects seen again.
    """

    loops: Edges
    visits: Edges
    landmarks: Edges

    @staticmethod
    def none() -> Constraints:
        """No edges."""
        return Constraints(Edges.none(), Edges.none(), Edges.none())

    @staticmethod
    def concatenate(parts: Sequence[Constraints]) -> Constraints:
        """The edges of all parts, in order."""
        return Constraints(
            Edges.concatenate([part.loops for part in parts]),
            Edges.concatenate([part.visits for part in parts]),
            Edges.concatenate([part.landmarks for part in parts]),
        )

    def renumbered(self, key: Ints) -> Constraints:
        """The edges when key scan i is called `key[i]`; those of key scans that are called -1 are left out."""
        return Constraints(
            renumbered(self.loops, key), renumbered(self.visits, key), renumbered(self.landmarks, key)
        )


@dataclass(frozen=True, slots=True)
class Session:
    """Drives in the order in which they were mapped, and the final poses `(k, 3)` of all their key scans in one map frame.

    `parts` `(d,)` numbers the connected parts of the map: drives of different parts have not been found to overlap, and how
    the parts lie to each other is unknown. `objects` are the estimates of tagged objects, relative to key scans. `drawn` is the
    map as it was drawn last, of some or all of the drives; None: it is drawn anew.
    """

    drives: tuple[Drive, ...]
    poses: Floats
    parts: Ints
    constraints: Constraints
    objects: ObjectRecords = field(default_factory=ObjectRecords.none)
    drawn: DrawnState | None = None

    @property
    def first_key(self) -> Ints:
        """Drive d owns the key scans first_key[d]..first_key[d + 1] - 1 `(d + 1,)`."""
        return offsets_of(len(drive.keys) for drive in self.drives)

    @property
    def scans(self) -> Sequence[PreparedScan]:
        """The key scans of all drives."""
        if len(self.drives) == 1:
            return self.drives[0].scans
        return [scan for drive in self.drives for scan in drive.scans]

    def scans_at(self, rows: Ints) -> list[PreparedScan]:
        """The key scans with these numbers `(k,)`, which count over all drives."""
        drive = np.searchsorted(self.first_key, rows, side="right") - 1
        at = rows - self.first_key[drive]
        return [self.drives[d].scans[k] for d, k in zip(drive.tolist(), at.tolist(), strict=True)]

    def before(self, drive: int) -> Session:
        """The drives before one, without what holds them."""
        poses = self.poses[: self.first_key[drive]]
        return Session(self.drives[:drive], poses, self.parts[:drive], Constraints.none())

    def poses_of(self, drive: int) -> Floats:
        """Final poses `(k, 3)` of one drive's key scans in the map frame."""
        first = self.first_key
        return np.asarray(self.poses[first[drive] : first[drive + 1]])

    def trajectory(self, drive: int) -> Trajectory:
        """The path of one drive over all its scans."""
        return self.drives[drive].corrected(self.poses_of(drive))


def renumbered(edges: Edges, key: Ints) -> Edges:
    """The edges when key scan i is called `key[i]`; those of key scans that are called -1 are left out."""
    kept = (key[edges.source] >= 0) & (key[edges.target] >= 0)
    edges = edges.select(kept)
    return replace(edges, source=key[edges.source], target=key[edges.target])
