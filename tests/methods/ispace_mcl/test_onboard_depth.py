"""A robot without a lidar is localized by the ranges of its own depth camera."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gridslam.core.errors import LogError, MethodError
from gridslam.core.messages import CameraInfo, DepthImage, Event, LaserScan, Odometry, Transform
from gridslam.logs.requirements import require_streams
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.simulation.scene import Scene
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import WorldConfig
from tests.simulation.places import driven, room

pytest.importorskip("embreex", reason="cameras need the extra sim")

CAMERA: dict[str, Any] = {
    "name": "eye", "kind": "rgbd", "rate_hz": 4.0, "width_px": 128, "height_px": 48, "focal_px": 90.0, "depth_max_m": 9,
    "extrinsics": {"x": 0.15, "z": 0.5, "pitch_deg": 5},
}  # fmt: skip


@pytest.fixture(scope="module")
def drive() -> tuple[WorldConfig, OccupancyGrid, list[Event], np.ndarray]:
    """A round through a furnished room with a camera and no lidar: world, map, events, and the last true pose."""
    world = room(
        walls=[{"rectangle": [0, 0, 8, 5]}, {"points": [[5, 0], [5, 1.5]]}],
        boxes=[{"centre": [2, 4.4], "size": [1.4, 0.8]}, {"centre": [7.5, 3.6], "size": [0.8, 0.6]}],
        robot={"start": [1.5, 1.5, 0], "route": [[3.8, 2.2], [6.2, 2.5], [4, 3.5], [1.5, 2.5]]},
        sensors={"cameras": [CAMERA], "odometry": {}},
    )
    simulator, events = driven(world)
    scene: Scene = simulator.scene
    return world, true_map(scene, world.truth), [*simulator.extrinsics(), *events], simulator.robot.pose


def located(events: list[Event], grid: OccupancyGrid, **changes: Any) -> Any:
    method = IspaceMcl(IspaceMclConfig.model_validate(changes), 0, grid)
    for event in events:
        method.process(event)
    return method.result()


def test_depth_images_stand_in_for_a_lidar(drive: Any) -> None:
    _, grid, events, last = drive
    result = located(events, grid, start=(1.5, 1.5, 0.0))
    images = sum(isinstance(e, DepthImage) for e in events)
    assert result.counters["used.scan"] == result.counters["used.depth"] == images
    assert np.hypot(*(result.trajectory.poses[-1, :2] - last[:2])) < 0.15
    assert result.measures["localization"]["status_at_end"] == "localized"


def test_they_find_a_robot_that_may_be_anywhere(drive: Any) -> None:
    _, grid, events, last = drive
    result = located(events, grid)
    assert np.hypot(*(result.trajectory.poses[-1, :2] - last[:2])) < 0.3


def test_with_a_lidar_they_are_left_alone(drive: Any) -> None:
    _, grid, events, _ = drive
    depth = next(e for e in events if isinstance(e, DepthImage))
    scan = LaserScan(depth.stamp_ns + 1, "laser", np.full(90, 2.0, np.float32), -1.5, 0.03, 0.1, 9.0)
    early = [e for e in events if not isinstance(e, Odometry) or e.stamp_ns < depth.stamp_ns + 10**9]
    with_scan = sorted([*early, scan], key=lambda e: 0 if isinstance(e, Transform) else e.stamp_ns)
    result = located(with_scan, grid)
    assert result.counters["used.scan"] == 1
    assert "used.depth" not in result.counters
    assert result.counters["skipped.depth.not_fixed"] == sum(isinstance(e, DepthImage) for e in events)


def test_without_calibration_they_are_counted_and_the_run_says_what_is_missing(drive: Any) -> None:
    _, grid, events, _ = drive
    with pytest.raises(MethodError, match=r"neither a scan nor .* depth .*no_calibration"):
        located([e for e in events if not isinstance(e, CameraInfo)], grid)


def test_one_of_both_streams_will_do() -> None:
    class Info:
        def __init__(self, kind: str) -> None:
            self.kind, self.used, self.count, self.label, self.type = kind, True, 3, f"/{kind}", "some"

    class FakeLog:
        path = "a.mcap"
        is_lossy = False

        def __init__(self, *kinds: str) -> None:
            self.streams = [Info(kind) for kind in kinds]

    needs = ("scan|depth", "odom")
    require_streams(FakeLog("depth", "odom"), needs)  # type: ignore[arg-type]
    require_streams(FakeLog("scan", "odom"), needs)  # type: ignore[arg-type]
    with pytest.raises(LogError, match=r"no scan or depth stream.*topics: \{scan: TOPIC\}"):
        require_streams(FakeLog("image", "odom"), needs)  # type: ignore[arg-type]
