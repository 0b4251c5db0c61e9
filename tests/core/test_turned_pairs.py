"""The angle between beams, found from scans of a robot that turns in a room with known walls."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.turned_pairs import MIN_PAIRS, TurnedPairs
from tests.small_log import wall_ranges

BEAMS = 361


def scans_while_rotating(width_deg: float, scans: int = 40) -> TurnedPairs:
    """Scans of a robot that turns on the spot by 0.2 rad from scan to scan; the beams cover `width_deg`."""
    pairs = TurnedPairs()
    bearings = np.radians(np.linspace(-0.5 * width_deg, 0.5 * width_deg, BEAMS))
    for k in range(scans):
        yaw = 0.2 * k
        pairs.add((1.0, 0.5, yaw), wall_ranges(1.0, 0.5, yaw + bearings).astype(np.float32))
    return pairs


@pytest.mark.parametrize("width_deg", [240.0, 270.0, 360.0])
def test_the_step_with_which_the_readings_agree_is_found(width_deg: float) -> None:
    steps = [math.radians(width) / (BEAMS - 1) for width in (180.0, 240.0, 270.0, 360.0)]
    found = scans_while_rotating(width_deg).better_step(BEAMS, steps[0], steps[1:])
    assert found == pytest.approx(math.radians(width_deg) / (BEAMS - 1))


def test_no_other_step_is_better_than_the_right_one() -> None:
    steps = [math.radians(width) / (BEAMS - 1) for width in (180.0, 240.0)]
    assert scans_while_rotating(180.0).better_step(BEAMS, steps[0], steps[1:]) is None


def test_a_wrong_step_is_kept_if_there_are_too_few_pairs() -> None:
    steps = [math.radians(width) / (BEAMS - 1) for width in (180.0, 240.0)]
    too_few = scans_while_rotating(240.0, scans=MIN_PAIRS)  # one pair fewer
    assert too_few.better_step(BEAMS, steps[0], steps[1:]) is None
