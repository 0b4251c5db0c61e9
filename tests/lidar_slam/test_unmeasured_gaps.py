from __future__ import annotations

import numpy as np
import pytest

from gridslam.lidar_slam.front_end import ScanMatch
from gridslam.lidar_slam.unmeasured_gaps import UnmeasuredGaps

FOUND, LOST = ScanMatch(np.zeros(3), 0.8, True), ScanMatch(np.zeros(3), 0.3, True)


@pytest.mark.parametrize(
    ("elapsed_s", "speed_mps", "match", "is_doubted"),
    [
        (3.0, 0.0, LOST, True),
        (3.0, 0.0, ScanMatch(np.zeros(3), 0.8, False), True),
        (3.0, 0.0, FOUND, False),
        (3.0, 0.8, FOUND, True),
        (0.3, 0.8, LOST, False),
    ],
)
def test_a_gap_is_doubted_where_the_robot_may_be_elsewhere_after_it(
    elapsed_s: float, speed_mps: float, match: ScanMatch, is_doubted: bool
) -> None:
    gaps = UnmeasuredGaps()
    gaps.add(0.1, 0.8, FOUND)
    assert gaps.doubt is None
    gaps.add(elapsed_s, speed_mps, match)
    assert ("3.0 s without a scan" in (gaps.doubt or "")) is is_doubted
