"""Depth images whose unit is not that of their encoding."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import DepthImage, Event
from gridslam.logs import open_log, write_log

SCENE = np.linspace(0.4, 6.0, 20 * 30).reshape(20, 30)  # m


def played(
    path: Path, depths: np.ndarray, kinds: tuple[str, ...] | None = ("depth",)
) -> tuple[np.ndarray, list[str]]:
    """The depths of a log of two such images, and what the log says."""
    events: list[Event] = [DepthImage(k * 10**8, "optical", depths.astype(np.float32), "cam") for k in (1, 2)]
    write_log(path, events, force=True)
    with open_log(path, kinds=kinds) as log:
        found = [e for e in log.events() if isinstance(e, DepthImage)]
        return np.stack([e.depth_m for e in found]), log.problems


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_depths_that_are_off_by_a_thousand_become_metres_and_the_log_says_so(
    tmp_path: Path, factor: float
) -> None:
    depths, problems = played(tmp_path / "a.mcap", factor * SCENE)
    assert depths == pytest.approx(np.stack([SCENE, SCENE]), rel=1e-5)
    assert any("the recorder's unit is another" in line for line in problems)


@pytest.mark.parametrize("scene", [SCENE, 10.0 * SCENE, 0.1 * SCENE])
def test_depths_that_may_be_metres_are_unchanged(tmp_path: Path, scene: np.ndarray) -> None:
    depths, problems = played(tmp_path / "a.mcap", scene)
    assert depths == pytest.approx(np.stack([scene, scene]), rel=1e-6)
    assert not any("unit" in line for line in problems)


def test_an_image_without_depths_says_nothing_about_the_unit(tmp_path: Path) -> None:
    _, problems = played(tmp_path / "a.mcap", np.full((20, 30), np.nan))
    assert not any("unit" in line for line in problems)
