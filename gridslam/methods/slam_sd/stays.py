"""Where an object has stood, and from when to when; poses hang on key scans and follow their correction."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.things import Thing

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Stay:
    """One place of an object: the pivot's pose (3,) and covariance `(3, 3)` in the frame of the robot at key scan `anchor`.

    `closed_yaw` is the heading of the closed leaf in that frame (doors only). Stamps are those of the first and last read here;
    `gone_ns`, when set, that of the moment from which it was known to stand here no longer.
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

    def placed(self, path: Floats) -> Floats:
        """The pivot's pose (3,) in the map frame, for a path `(k, 3)` over the key scans."""
        return se2.compose(path[self.anchor], self.pose)

    def covariance_in_map(self, path: Floats) -> Floats:
        """The covariance `(3, 3)` turned into the map frame."""
        return turned(self.covariance, float(path[self.anchor, 2]))

    @property
    def door_angle(self) -> float | None:
        """How far the leaf is turned from its wall (rad)."""
        if self.closed_yaw is None:
            return None
        return float(se2.wrap_angle(self.pose[2] - self.closed_yaw))


@dataclass(slots=True)
class TrackedObject:
    """An object with all the places where it was found, the present one last; `seen` are its estimates, visit by visit."""

    thing: Thing
    stays: list[Stay] = field(default_factory=list)
    seen: list[Stay] = field(default_factory=list)
    silence: float = 0.0  # log probability of the silent rounds since the last read, if it still stood there

    @property
    def has_moved(self) -> bool:
        """Whether it was found elsewhere, or no longer found."""
        return len(self.stays) > 1 or any(stay.gone_ns is not None for stay in self.stays)

    @property
    def present(self) -> Stay | None:
        """Where it stands as far as is known."""
        return self.stays[-1] if self.stays and self.stays[-1].gone_ns is None else None

    def at(self, stamp_ns: int) -> list[Stay]:
        """Where it may have stood at a moment: two places for the time in which it was moved unseen."""
        found = []
        for i, stay in enumerate(self.stays):
            since = self.stays[i - 1].last_ns if i else None
            until = self.stays[i + 1].first_ns if i + 1 < len(self.stays) else stay.gone_ns
            if (since is None or stamp_ns > since) and (until is None or stamp_ns < until):
                found.append(stay)
        return found


def turned(covariance: Floats, yaw: float) -> Floats:
    """A covariance over x, y, yaw `(3, 3)` with its axes turned by `yaw`."""
    c, s = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(rotation @ covariance @ rotation.T)
