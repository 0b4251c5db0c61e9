"""Worlds whose simulation is too much work are refused, and say what takes it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gridslam.core.errors import ConfigError
from gridslam.simulation import work
from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import WorldConfig, builtin_worlds, load_world, validate_world


def world(**sections: Any) -> WorldConfig:
    """A room with a drive of 1 m, and other sections."""
    room: dict[str, Any] = {
        "walls": [{"rectangle": [0, 0, 8, 6]}],
        "robot": {"start": [1, 1, 0], "route": [[2, 1]]},
    }
    return validate_world(room | sections, "world.yaml")


def objects(count: int) -> list[dict[str, Any]]:
    return [{"id": f"o{i}", "pose": [4, 3, 0], "size": [0.2, 0.2]} for i in range(count)]


CAMERA = {"kind": "rgbd", "name": "eye", "width_px": 4095, "height_px": 4095, "rate_hz": 34}
PEOPLE = [{"path": [[1, 1], [5, 5]]}] * 30_000
SLOW = {
    "camera eye": {"sensors": {"cameras": [CAMERA]}},
    "camera roof": {"fixed_cameras": [CAMERA | {"name": "roof"}]},
    "lidar": {
        "sensors": {"lidar": {"beams": 10_000, "rate_hz": 100, "sweep_s": 0.01}},
        "objects": objects(6000),
    },
    "lidar ": {"sensors": {"lidar": {"rate_hz": 100, "sweep_s": 0.01}}, "people": PEOPLE},
}


@pytest.mark.parametrize("cause", SLOW)
def test_what_takes_minutes_a_second_is_refused_in_the_world(cause: str) -> None:
    with pytest.raises(
        ConfigError,
        match=rf"world\.yaml: .*a second of the drive takes some .* {cause.strip()};.*at most 120 s",
    ):
        world(**SLOW[cause])


LONG = {
    "camera eye": {
        "sensors": {"cameras": [CAMERA | {"width_px": 1920, "height_px": 1080}]},
        "robot": {"start": [1, 1, 0], "path": [{"seconds": 3000}]},
    },
    "infrared": {
        "sensors": {"infrared": [{"name": "ir", "step_deg": 0.012}]},
        "robot": {"start": [1, 1, 0], "route": [[2, 1]], "stops": {"every_m": 1e-6}},
    },
    "objects at waypoints": {
        "robot": {"start": [1, 1, 0], "route": [[2, 1]] * 1000, "laps": 1000},
        "objects": objects(1000),
    },
}


@pytest.mark.parametrize("cause", LONG)
def test_a_drive_of_hours_of_work_is_refused_before_it_starts(cause: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=rf"most of them for {cause}; at most 60 minutes"):
        record_world(world(**LONG[cause]), tmp_path, tmp_path / "log.mcap")
    assert not list(tmp_path.iterdir())


def test_a_drive_that_does_not_arrive_ends_with_its_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "MAX_WORK_S", 0.05)  # 5 simulated seconds
    behind_a_wall = {"robot": {"start": [1, 1, 0], "route": [[1.5, 1]], "arrival_m": 1e-6}}
    with pytest.raises(ConfigError, match="the drive is not over after 5 s"):
        record_world(world(**behind_a_wall), tmp_path, tmp_path / "log.mcap")


def test_the_built_in_worlds_are_far_below_the_limits() -> None:
    for name in builtin_worlds():
        built_in, _ = load_world(name)
        work.refuse_long(built_in)
        assert sum(work.work_per_second(built_in).values()) < 0.1 * work.MAX_SLOWDOWN
