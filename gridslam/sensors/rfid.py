"""RFID reader: the probability that a round of one antenna reads a tag, over distance, bearing and the tag's facing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels import object_weights

Floats = NDArray[np.float64]
PROFILE_BINS = 360
OPEN_M = 1e6  # nothing was seen this way: nothing hides a tag there


@dataclass(frozen=True, slots=True)
class AntennaModel:
    """P(read) = p_stray + (1 - p_stray) * p_most / (1 + exp((d - limit) / (softness * reach_m))),

    limit = reach_m * (1 + cos bearing) / 2 * max((1 + cos facing) / 2, least_facing): a soft range limit about the antenna's
    axis and the tag's normal (P(I|D) of the slam-sd paper's eq. 6). A tag hidden from the reader keeps `hidden_share` of it.
    """

    reach_m: float = 2.0
    softness: float = 0.12
    p_most: float = 0.93
    p_stray: float = 0.003
    hidden_share: float = 0.1
    least_facing: float = 0.25

    @property
    def parameters(self) -> Floats:
        """As the kernel takes them `(6,)`."""
        return np.array(
            [self.reach_m, self.softness, self.p_most, self.p_stray, self.hidden_share, self.least_facing]
        )


@dataclass(frozen=True, slots=True)
class Rounds:
    """Inventory rounds: antenna poses `(r, 3)`, and for each which scan `(r,)` shows what stood about the robot then.

    `viewpoints` `(s, 3)` and `profiles` `(s, bins)` are those of the scans (`range_profile`).
    """

    antennas: Floats
    scan_of_round: NDArray[np.int64]
    viewpoints: Floats
    profiles: Floats

    def log_likelihood(
        self, tags: Floats, is_read: NDArray[np.bool_], model: AntennaModel, slack_m: float = 0.1
    ) -> Floats:
        """log P(I|D) `(n,)` for tag poses `(n, 3)`, given which rounds read the tag `(r,)`."""
        return np.asarray(
            object_weights.tag_log_likelihood(
                np.ascontiguousarray(tags),
                self.antennas,
                is_read,
                self.scan_of_round,
                self.viewpoints,
                self.profiles,
                slack_m,
                model.parameters,
            )
        )


def range_profile(points: Floats, viewpoint: Floats) -> Floats:
    """Ranges `(bins,)` from a viewpoint to scan points `(m, 2)`, the farthest in each bin of the bearing.

    A bin between two others that were measured takes the farther of them; where nothing was measured, nothing hides.
    """
    way = points - viewpoint[:2]
    bearing = (np.arctan2(way[:, 1], way[:, 0]) - viewpoint[2]) / (2.0 * np.pi)
    cell = np.minimum(((bearing - np.floor(bearing)) * PROFILE_BINS).astype(np.int64), PROFILE_BINS - 1)
    profile = np.zeros(PROFILE_BINS)
    np.maximum.at(profile, cell, np.hypot(way[:, 0], way[:, 1]))
    widened = np.maximum(profile, np.maximum(np.roll(profile, 1), np.roll(profile, -1)))
    return np.where(widened > 0.0, widened, OPEN_M)
