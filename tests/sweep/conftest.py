"""Sweeps of the test method over a small log, done in the tests' own process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from gridslam.methods import registry
from gridslam.sweep.config import SweepConfig, load_sweep
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.sweep import SweepResult, run_sweep
from gridslam.sweep.work import Job, execute
from tests.dead_reckoning import register

WORLD = """
walls: [{rectangle: [-4, -3, 4, 3]}]
robot: {start: [-1, 0, 0], speed_mps: 0.5, route: [[0, 0]]}
sensors:
  lidar: {rate_hz: 5, beams: 61, field_of_view_deg: 180, range_max_m: 10}
  odometry: {rate_hz: 10}
"""


class Bench:
    """A folder with a config and a log, and what was run there so far."""

    def __init__(self, folder: Path, log: Path) -> None:
        self.folder = folder
        self.output = folder / "out"
        self.ran: list[str] = []
        self.reported: list[str] = []
        self.logs: list[dict[str, Any]] = [{"name": "room", "log": str(log), "truth": str(log)}]
        (folder / "plain.yaml").write_text("method: {name: dead-reckoning}\n")

    def take_world(self) -> None:
        """The log is simulated from now on: two seconds in a room."""
        (self.folder / "hall.yaml").write_text(WORLD)
        self.logs = [{"world": "hall.yaml"}]

    def sweep(self, **changes: Any) -> SweepConfig:
        document = {
            "command": "map",
            "logs": self.logs,
            "configs": ["plain.yaml"],
            "seeds": "0..2",
            **changes,
        }
        path = self.folder / "sweep.yaml"
        path.write_text(yaml.safe_dump(document, sort_keys=False))
        return load_sweep(path)

    def run(
        self, order: Callable[[Sequence[int]], Sequence[int]] = list, max_jobs: int = 999, **changes: Any
    ) -> SweepResult:
        """Run a sweep with its jobs in a given order, and stop after `max_jobs`; `ran` then lists the jobs that were executed."""
        self.ran, self.reported = [], []

        def inline(jobs: Sequence[Job]) -> Iterator[tuple[int, JobResult]]:
            for place in list(order(range(len(jobs))))[:max_jobs]:
                yield place, self._do(jobs[place])

        return run_sweep(
            self.sweep(**changes), self.folder, self.output, inline, self.reported.append, lambda: False
        )

    def _do(self, job: Job) -> JobResult:
        measured_only = getattr(job, "is_made", False)
        self.ran.append(f"{job.label}{' (measured)' if measured_only else ''}")
        return execute(job, lambda: False)

    def tables(self) -> Mapping[str, bytes]:
        """The files that must not depend on how the work was done."""
        names = ("runs.csv", "runs.json", "summary.csv", "summary.json")
        return {name: (self.output / name).read_bytes() for name in names}


@pytest.fixture
def bench(tmp_path: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A place for sweeps of the method `dead-reckoning`."""
    monkeypatch.setattr(registry, "METHODS", register())
    return Bench(tmp_path, small_log)


@pytest.fixture
def sweep_file(tmp_path: Path, small_log: Path) -> Path:
    """Four short runs of slam-sd."""
    document = {
        "command": "map",
        "logs": [{"name": "room", "log": str(small_log), "truth": str(small_log)}],
        "configs": ["slam-sd"],
        "overrides": {"few": ["method.particles=3", "method.pose_graph.enabled=false"]},
        "seeds": "0..2",
    }
    path = tmp_path / "sweep.yaml"
    path.write_text(yaml.safe_dump(document))
    return path
