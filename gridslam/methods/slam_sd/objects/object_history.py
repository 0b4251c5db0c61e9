"""The poses of an object over time. They are relative to key scans, so that corrections of the key scans move them as well."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.object_model import ObjectModel

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ObjectEpisode:
    """An object at one place, over a time in which it did not move.

    `pose` `(3,)` (m, m, rad) and `covariance` `(3, 3)` are those of the object's pivot in the robot's frame at key scan `anchor`.
    `reads` is the number of tag reads at this place, `first_ns` and `last_ns` are the stamps of the first and the last. `gain` is
    the log likelihood ratio of the scans with and without the object. `closed_yaw` (rad) is the heading of the leaf when the door
    is closed, in the frame of `pose`; None if the object is not a door or its wall is unknown. `gone_ns` is the stamp at which
    the object was found to be gone; None if it was not.
    """

    anchor: int
    pose: Floats
    covariance: Floats
    first_ns: int
    last_ns: int
    reads: int
    gain: float
    closed_yaw: float | None = None
    gone_ns: int | None = None

    def pose_in_map(self, path: Floats) -> Floats:
        """The pivot's pose `(3,)` in the map frame; `path` `(k, 3)` are the poses of the key scans."""
        return se2.compose(path[self.anchor], self.pose)

    def covariance_in_map(self, path: Floats) -> Floats:
        """The covariance `(3, 3)` in the map frame; `path` `(k, 3)` are the poses of the key scans."""
        return se2.rotate_covariance(self.covariance, float(path[self.anchor, 2]))

    @property
    def door_angle(self) -> float | None:
        """Angle (rad) between the leaf and its wall; None if the wall is unknown."""
        if self.closed_yaw is None:
            return None
        return float(se2.wrap_angle(self.pose[2] - self.closed_yaw))


@dataclass(slots=True)
class ObjectHistory:
    """An object, its estimates (one per visit of the robot), and the episodes into which they are merged (one per place).

    The last episode is the present one. `log_silence` is the log probability that no tag of the object was read in all rounds
    since its last read, given that it is still there.
    """

    model: ObjectModel
    episodes: list[ObjectEpisode] = field(default_factory=list)
    estimates: list[ObjectEpisode] = field(default_factory=list)
    log_silence: float = 0.0

    @property
    def has_moved(self) -> bool:
        """Whether the object was found at another place, or found to be gone."""
        return len(self.episodes) > 1 or any(episode.gone_ns is not None for episode in self.episodes)

    @property
    def present(self) -> ObjectEpisode | None:
        """The present episode; None if the object was never found or is gone."""
        return self.episodes[-1] if self.episodes and self.episodes[-1].gone_ns is None else None

    def at(self, stamp_ns: int) -> list[ObjectEpisode]:
        """The episodes that are possible at a stamp: two between the last read at one place and the first at the next."""
        possible = []
        for i, episode in enumerate(self.episodes):
            since = self.episodes[i - 1].last_ns if i else None
            until = self.episodes[i + 1].first_ns if i + 1 < len(self.episodes) else episode.gone_ns
            if (since is None or stamp_ns > since) and (until is None or stamp_ns < until):
                possible.append(episode)
        return possible
