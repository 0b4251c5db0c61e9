"""RFID reader: probability that a round of one antenna reads a tag, by distance, bearing and the tag's facing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels import object_weights

Floats = NDArray[np.float64]
PROFILE_BINS = 360
OPEN_M = 1e6  # range where nothing was measured: nothing hides a tag there


@dataclass(frozen=True, slots=True)
class AntennaModel:
    """P(read) = p_false + (1 - p_false) * p_detection / (1 + exp((d - limit) / (softness * range_m))).

    limit = range_m * (1 + cos bearing) / 2 * max((1 + cos facing) / 2, min_facing) is a soft range limit about the antenna's
    axis and the tag's normal (P(I|D) of the slam-sd paper's eq. 6). For a hidden tag p_detection is multiplied by `hidden_ratio`.
    """

    range_m: float = 2.0
    softness: float = 0.12
    detection_probability: float = 0.93
    false_read_probability: float = 0.003
    hidden_ratio: float = 0.1
    min_facing: float = 0.25

    @property
    def parameters(self) -> object_weights.AntennaParameters:
        """The parameters as the kernel takes them."""
        return object_weights.AntennaParameters(
            self.range_m,
            self.softness,
            detection_probability=self.detection_probability,
            false_read_probability=self.false_read_probability,
            hidden_ratio=self.hidden_ratio,
            min_facing=self.min_facing,
        )


@dataclass(frozen=True, slots=True)
class RoundGeometry:
    """Inventory rounds: antenna poses `(r, 3)`, and for each the scan `(r,)` that shows what stood around the robot then.

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
                object_weights.ReaderRounds(
                    self.antennas, self.scan_of_round, self.viewpoints, self.profiles
                ),
                is_read,
                slack_m,
                model.parameters,
            )
        )


def range_profile(points: Floats, viewpoint: Floats) -> Floats:
    """Largest range `(bins,)` per bin of the bearing, from a viewpoint (3,) to scan points `(m, 2)`.

    Each bin also takes the larger range of its two neighbours; a bin without any measurement hides nothing.
    """
    offset = points - viewpoint[:2]
    bearing = (np.arctan2(offset[:, 1], offset[:, 0]) - viewpoint[2]) / (2.0 * np.pi)
    cell = np.minimum(((bearing - np.floor(bearing)) * PROFILE_BINS).astype(np.int64), PROFILE_BINS - 1)
    profile = np.zeros(PROFILE_BINS)
    np.maximum.at(profile, cell, np.hypot(offset[:, 0], offset[:, 1]))
    widened = np.maximum(profile, np.maximum(np.roll(profile, 1), np.roll(profile, -1)))
    return np.where(widened > 0.0, widened, OPEN_M)
