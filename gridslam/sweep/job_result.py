"""What came of a run of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from gridslam.evaluation.gates import Value

State = Literal["done", "failed", "not run"]


@dataclass(frozen=True, slots=True)
class JobResult:
    """A finished piece of work, or why it failed.

    `measures` are the dotted keys of the evaluation, `cost` its seconds and memory: these differ from one time to
    the next and are kept out of the tables that are compared.
    """

    state: State
    error: str = ""
    measures: Mapping[str, Value] = field(default_factory=dict)
    cost: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunRow:
    """A line of the table of runs."""

    log: str
    config: str
    override: str
    seed: int
    result: JobResult
    measures: Mapping[str, Value]  # the result's and the sweep's own successes

    @property
    def is_done(self) -> bool:
        """Whether the run was made and measured."""
        return self.result.state == "done"

    @property
    def label(self) -> str:
        """How messages name the run."""
        return f"{self.log} {self.config} {self.override} seed {self.seed}"
