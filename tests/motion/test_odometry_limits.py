from __future__ import annotations

import pytest

from gridslam.motion.odometry_limits import OdometryLimits

LIMITS = OdometryLimits(max_speed_mps=2.0, max_yaw_rate_radps=1.0, tolerance_m=0.1, tolerance_rad=0.2)


@pytest.mark.parametrize(
    ("distance_m", "rotation_rad", "elapsed_s", "jumped"),
    [
        (1.0, 0.5, 0.5, False),
        (1.2, 0.0, 0.5, True),
        (0.0, 0.8, 0.5, True),
        (0.0, -0.8, 0.5, True),
        (0.05, 0.1, 0.0, False),  # equal stamps: only the tolerances
        (0.11, 0.0, 0.0, True),
    ],
)
def test_a_motion_beyond_speed_or_yaw_rate_is_a_jump(
    distance_m: float, rotation_rad: float, elapsed_s: float, jumped: bool
) -> None:
    assert LIMITS.has_jumped(distance_m, rotation_rad, elapsed_s) is jumped
