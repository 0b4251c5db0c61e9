"""A finished run to write down."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods import registry
from gridslam.methods.base import RunResult, Series, Table
from gridslam.runs.run import Run
from gridslam.runs.run_config import validate_run_config
from gridslam.runs.run_counts import merge_counts
from tests.dead_reckoning import register

STAMPS = np.array([1_700_000_000_123_456_789, 1_700_000_000_223_456_788, 1_700_000_001_000_000_001], np.int64)


@pytest.fixture
def finished_run(monkeypatch: pytest.MonkeyPatch) -> Run:
    """Three poses, a map of 4 x 5 cells, a table, a series and a truth."""
    monkeypatch.setattr(registry, "METHODS", register())
    config = validate_run_config({"method": {"name": "dead-reckoning"}, "seed": 5}, "test")
    probability = np.full((4, 5), np.nan, np.float32)
    probability[1:3, 1:4] = [[0.1, 0.9, 0.5], [0.0, 1.0, 0.3]]
    grid = OccupancyGrid(probability, GridGeometry(0.05, (-1.25, 0.1)))
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi / 2], [1.0, 2.0, np.pi]])
    result = RunResult(
        Trajectory(STAMPS, poses),
        occupancy=grid,
        layers={"hits": GridLayer(np.arange(20, dtype=np.float32).reshape(4, 5), grid.geometry)},
        tables={"objects": Table(("stamp_ns", "x", "moved"), [(int(STAMPS[0]), 0.1, True)])},
        series={"n_eff": Series(STAMPS, np.array([30.0, 12.5, np.nan]), "particles")},
        counters={"used.scan": 3, "skipped.scan.too_short": 2},
        timings_s={"matching": 0.25},
        measures={"confidence": {"mean": np.float64(0.5), "worst": float("nan")}},
    )
    return Run(
        command="map",
        config=config,
        log_path=Path("logs/<room> & more.mcap"),
        inputs={"room.mcap": "ab" * 32},
        result=result,
        occupancy=grid,
        truth=Trajectory(STAMPS, poses + np.array([3.0, -1.0, 0.0])),
        status="lossy",
        is_lossy=True,
        problems=("skipped 2 x scan nan, first at message 3",),
        counts=merge_counts(
            {"read.scan": 5, "read.odom": 9, "skipped.scan.nan": 2, "lost.bytes": 1}, result.counters
        ),
        read_s=0.5,
        process_s=1.5,
    )
