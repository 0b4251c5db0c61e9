from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import LaserScan, Odometry
from gridslam.logs import open_log

TURNED = (
    "O 100.0 -200.0 7.0 0.5\n"
    "L 100.0 200.0 1.570796 100.0 225.0 1.570796 100 250 8191 0.625\n"
    "L 100.0 200.0 1.570796 100.0 225.0 1.570796 x 250 8191 0.75\n"
    "O 100.0 nan 0.0 0.875\n"
)


def test_centimetres_become_metres_and_the_sensor_sits_where_the_line_says(tmp_path: Path) -> None:
    path = tmp_path / "robotdata.log"
    path.write_text(TURNED)
    with open_log(path, kinds=["scan", "odom"]) as log:
        extrinsics, first, second, scan = log.events()
        assert log.format == "Wean Hall text"
        assert log.counters["skipped.scan.unreadable_line"] == 1
        assert log.counters["skipped.odom.not_finite"] == 1
    assert extrinsics.translation_m == (0.25, 0.0, 0.0)
    assert isinstance(first, Odometry)
    assert (first.stamp_ns, first.x_m, first.y_m) == (500_000_000, 1.0, -2.0)
    assert first.yaw_rad == pytest.approx(7.0 - 2 * np.pi)
    assert isinstance(scan, LaserScan)
    assert second.stamp_ns == scan.stamp_ns == 625_000_000
    assert scan.ranges_m.tolist() == pytest.approx([1.0, 2.5, 81.91])
    assert scan.ranges_m[2] > scan.range_max_m
