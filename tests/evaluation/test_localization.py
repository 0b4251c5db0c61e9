from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.evaluation.localization import judge_localization
from gridslam.evaluation.pose_errors import PoseErrors

STAMPS = np.arange(5) * 10**9 + 7 * 10**9


def errors(translation_m: list[float], rotation_deg: list[float] | None = None) -> PoseErrors:
    return PoseErrors(np.array(translation_m), np.array(rotation_deg or [0.0] * len(translation_m)))


@pytest.mark.parametrize(
    ("translation_m", "rotation_deg", "time_s"),
    [
        ([0.1, 0.1, 0.1, 0.1, 0.1], None, 1.0),
        ([9.0, 0.1, 9.0, 0.1, 0.1], None, 4.0),
        ([0.1, 0.1, 0.1, 0.1, 0.1], [50.0, 50.0, 1.0, 1.0, 1.0], 3.0),
    ],
)
def test_convergence_is_when_the_last_good_stretch_begins(
    translation_m: list[float], rotation_deg: list[float] | None, time_s: float
) -> None:
    found = judge_localization(STAMPS, errors(translation_m, rotation_deg), start_ns=6 * 10**9)
    assert found.success
    assert found.time_to_convergence_s == time_s


def test_a_robot_lost_at_the_end_is_no_success() -> None:
    found = judge_localization(STAMPS, errors([0.1, 0.1, 0.1, 0.1, 0.5]), start_ns=0)
    assert not found.success
    assert math.isnan(found.time_to_convergence_s)
