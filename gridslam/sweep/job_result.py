"""Results of the jobs of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from gridslam.evaluation.gates import Value

State = Literal["done", "failed", "not run"]


@dataclass(frozen=True, slots=True)
class JobResult:
    """The result of a job, or the error with which it failed.

    `measures` are by dotted key; `cost` has times (s) and memory (MB). Costs differ between repetitions, and are in a separate
    table.
    """

    state: State
    error: str = ""
    measures: Mapping[str, Value] = field(default_factory=dict)
    cost: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunRow:
    """A row of the table of runs."""

    log: str
    config: str
    override: str
    seed: int
    result: JobResult
    measures: Mapping[str, Value]  # of the result, and the sweep's successes

    @property
    def is_done(self) -> bool:
        """Whether the run finished and was evaluated."""
        return self.result.state == "done"

    @property
    def label(self) -> str:
        """The run's name in messages."""
        return f"{self.log} {self.config} {self.override} seed {self.seed}"
