"""Logs whose clock is set back while the robot drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.api import map_log
from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.core.stamps import NS_PER_S
from gridslam.logs import write_log
from tests.small_log import wall_ranges

BEAMS, SECONDS = 120, 8.0
BEARINGS = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)


def pose_at(time_s: float) -> tuple[float, float, float]:
    """On an ellipse."""
    phase = 2 * np.pi * time_s / 40
    x, y = 1.5 * np.cos(phase), 1.2 * np.sin(phase)
    return float(x), float(y), float(np.arctan2(1.2 * np.cos(phase), -1.5 * np.sin(phase)))


def write_stepping_log(path: Path, step_s: float, odom_hz: int) -> np.ndarray:
    """A log with perfect odometry, whose clock is set back in the middle; returns the poses of its scans."""
    times = [(k / odom_hz, "odom") for k in range(int(SECONDS * odom_hz))]
    times += [(k / 10 + 1e-6, "scan") for k in range(int(SECONDS * 10))]
    events: list[Event] = []
    true = []
    for time_s, kind in sorted(times):
        stamp_ns = 1_700_000_000 * NS_PER_S + round(
            (time_s - (step_s if time_s >= SECONDS / 2 else 0.0)) * NS_PER_S
        )
        x, y, yaw = pose_at(time_s)
        if kind == "odom":
            events.append(Odometry(stamp_ns, "odom", x, y, yaw))
            continue
        ranges = wall_ranges(x, y, yaw + BEARINGS).astype(np.float32)
        events.append(LaserScan(stamp_ns, "base_link", ranges, -np.pi, 2 * np.pi / BEAMS, 0.05, 20.0))
        true.append((x, y, yaw))
    write_log(path, events)
    return np.array(true)


@pytest.mark.parametrize("step_s", [0.3, 6.0])
@pytest.mark.parametrize("odom_hz", [10, 50])
def test_a_clock_that_is_set_back_leaves_the_poses_right(tmp_path: Path, step_s: float, odom_hz: int) -> None:
    true = write_stepping_log(tmp_path / "log.mcap", step_s, odom_hz)
    found = map_log(tmp_path / "log.mcap", "slam-sd").trajectory.poses
    expected = se2.between(true[:1], true)
    assert found.shape == expected.shape
    assert np.hypot(*(found - expected)[:, :2].T).max() < 0.03
