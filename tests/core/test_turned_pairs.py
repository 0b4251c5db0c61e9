"""The angle between beams by the turns of a robot in a room whose walls are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.turned_pairs import MIN_PAIRS, TurnedPairs
from tests.small_log import wall_ranges

BEAMS = 361


def turned(width_deg: float, scans: int = 40) -> TurnedPairs:
    """A robot that turns on the spot by 0.2 rad from scan to scan; its beams cover `width_deg`."""
    pairs = TurnedPairs()
    bearings = np.radians(np.linspace(-0.5 * width_deg, 0.5 * width_deg, BEAMS))
    for k in range(scans):
        yaw = 0.2 * k
        pairs.add((1.0, 0.5, yaw), wall_ranges(1.0, 0.5, yaw + bearings).astype(np.float32))
    return pairs


@pytest.mark.parametrize("width_deg", [240.0, 270.0, 360.0])
def test_the_step_with_which_the_readings_agree_is_found(width_deg: float) -> None:
    steps = [math.radians(width) / (BEAMS - 1) for width in (180.0, 240.0, 270.0, 360.0)]
    found = turned(width_deg).better_step(BEAMS, steps[0], steps[1:])
    assert found == pytest.approx(math.radians(width_deg) / (BEAMS - 1))


def test_a_right_step_is_kept_and_few_pairs_are_no_evidence() -> None:
    steps = [math.radians(width) / (BEAMS - 1) for width in (180.0, 240.0)]
    assert turned(180.0).better_step(BEAMS, steps[0], steps[1:]) is None
    assert turned(240.0, scans=MIN_PAIRS).better_step(BEAMS, steps[0], steps[1:]) is None
