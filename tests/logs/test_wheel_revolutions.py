from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.messages import WheelTicks
from gridslam.logs.checks.wheel_revolutions import WheelRevolutions
from gridslam.logs.message_counts import MessageCounts

LEFT = np.concatenate([np.linspace(0.0, 40.0, 200), np.linspace(40.0, -10.0, 250)])
RIGHT = 0.3 - 0.7 * LEFT


def repaired(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    counts = MessageCounts()
    revolutions = WheelRevolutions("/joint_states", counts)
    found = [
        revolutions.repaired(WheelTicks(i, "base", float(a), float(b)))
        for i, (a, b) in enumerate(zip(left, right, strict=True))
    ]
    return np.array([t.left_rad for t in found]), np.array([t.right_rad for t in found]), counts.problems


@pytest.mark.parametrize("low", [0.0, -math.pi])
def test_angles_that_start_anew_at_each_turn_become_continuous(low: float) -> None:
    wrapped = [(angles - low) % (2.0 * math.pi) + low for angles in (LEFT, RIGHT)]
    left, right, problems = repaired(*wrapped)
    np.testing.assert_allclose(np.diff(left), np.diff(LEFT), atol=1e-9)
    np.testing.assert_allclose(np.diff(right), np.diff(RIGHT), atol=1e-9)
    assert problems == ["/joint_states: wheel angles start anew at each turn: turns are added"]


def test_continuous_angles_are_unchanged() -> None:
    left, right, problems = repaired(LEFT, RIGHT)
    assert (left == LEFT).all()
    assert (right == RIGHT).all()
    assert not problems
