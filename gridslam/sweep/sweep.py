"""A sweep from its file to its tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

from gridslam.evaluation.gates import parse_gate
from gridslam.sweep.config import LogEntry, SweepConfig
from gridslam.sweep.contents import Hashes
from gridslam.sweep.gates import SweepGate, failed_gates, meets
from gridslam.sweep.outcome import Outcome, Row
from gridslam.sweep.plan import RunJob, Settings, run_job, settings_of_sweep, simulated, simulations
from gridslam.sweep.records import Records, sweep_directory
from gridslam.sweep.summary import Group, summarize
from gridslam.sweep.tables import summary_document, write_tables
from gridslam.sweep.work import Job, Stop

Runner: TypeAlias = Callable[[Sequence[Job]], Iterator[tuple[int, Outcome]]]
Tell: TypeAlias = Callable[[str], None]

NOT_RUN = Outcome("not run")


@dataclass(frozen=True, slots=True)
class SweepResult:
    """All runs in the order of the file, their groups, the gates that failed; `document` is summary.json."""

    rows: Sequence[Row]
    groups: Sequence[Group]
    failed_gates: Sequence[str]
    document: Mapping[str, Any]

    @property
    def failed(self) -> list[Row]:
        """The runs that failed."""
        return [row for row in self.rows if row.outcome.state == "failed"]

    @property
    def is_interrupted(self) -> bool:
        """Whether there are runs that were not tried."""
        return any(row.outcome.state == "not run" for row in self.rows)


def run_sweep(
    sweep: SweepConfig,
    folder: Path,
    output: Path,
    run: Runner,
    tell: Tell,
    stop: Stop,
    gates: Sequence[SweepGate] = (),
) -> SweepResult:
    """Do what is not done yet, and write the tables of all of it.

    `folder` is what the paths in the file are relative to, `run` does the work (`run_locally`, `run_on_cluster`),
    `tell` gets a line for each finished run. Raises ConfigError: before anything is run or written, for what is wrong.
    """
    settings = settings_of_sweep(sweep, folder)
    directory, hashes = output.resolve(), Hashes()
    worlds = list(simulations(sweep, folder, directory, hashes))
    combinations = list(product(sweep.logs, settings))
    # Runs on logs that are there are planned first: what is wrong with them is told before anything is simulated.
    planned = {
        place: run_job(sweep, folder, directory, entry, one, hashes)
        for place, (entry, one) in enumerate(combinations)
        if entry.world is None
    }
    with sweep_directory(directory):
        work = _Work(Records(directory), run, tell, stop)
        made = dict(zip([job.directory for job in worlds], work.do(worlds), strict=True))
        lost: dict[int, Outcome] = {}
        for place, (entry, one) in enumerate(combinations):
            if entry.world is not None:
                found = made[simulated(directory, entry.label, one.seed)]
                if found.state != "done":
                    lost[place] = _without_log(found)
                else:
                    planned[place] = run_job(sweep, folder, directory, entry, one, hashes)
        outcomes = (
            dict(zip(sorted(planned), work.do([planned[i] for i in sorted(planned)]), strict=True)) | lost
        )
        rows = [_row(sweep, entry, one, outcomes[i]) for i, (entry, one) in enumerate(combinations)]
        return _finish(sweep, directory, rows, [*sweep.gates(), *gates])


@dataclass(frozen=True, slots=True)
class _Work:
    """Jobs in, their outcomes out, in the order of the jobs; what is done already is not done again."""

    records: Records
    run: Runner
    tell: Tell
    stop: Stop

    def do(self, jobs: Sequence[Job]) -> list[Outcome]:
        found = [self.records.outcome(job) for job in jobs]
        left = [self._prepared(job) for job, outcome in zip(jobs, found, strict=True) if outcome is None]
        places = [place for place, outcome in enumerate(found) if outcome is None]
        if len(left) < len(jobs):
            self.tell(f"{len(jobs) - len(left)} of {len(jobs)} are done already")
        if left and not self.stop():
            for count, (place, outcome) in enumerate(self.run(left), start=1):
                self.records.write(left[place], outcome)
                found[places[place]] = outcome
                self.tell(f"{count}/{len(left)} {left[place].label}: {_in_words(outcome)}")
        return [NOT_RUN if outcome is None else outcome for outcome in found]

    def _prepared(self, job: Job) -> Job:
        return replace(job, is_made=self.records.is_made(job)) if isinstance(job, RunJob) else job


def _in_words(outcome: Outcome) -> str:
    return f"{outcome.cost['wall_s']:.1f} s" if outcome.state == "done" else f"failed: {outcome.error}"


def _without_log(simulation: Outcome) -> Outcome:
    if simulation.state == "not run":
        return NOT_RUN
    return Outcome("failed", f"its log could not be simulated: {simulation.error}")


def _row(sweep: SweepConfig, entry: LogEntry, settings: Settings, outcome: Outcome) -> Row:
    measures = dict(outcome.measures)
    if outcome.state == "done":
        for name, bounds in sweep.successes.items():
            measures[f"success.{name}"] = meets([parse_gate(text) for text in bounds], outcome.measures)
    return Row(entry.label, settings.config, settings.override, settings.seed, outcome, measures)


def _finish(sweep: SweepConfig, directory: Path, rows: list[Row], gates: Sequence[SweepGate]) -> SweepResult:
    groups = summarize(rows, [f"success.{name}" for name in sweep.successes])
    failures = failed_gates(gates, rows, groups)
    states = [row.outcome.state for row in rows]
    document = {
        "command": sweep.command,
        "status": "interrupted" if "not run" in states else "complete",
        "runs": {state.replace(" ", "_"): states.count(state) for state in ("done", "failed", "not run")},
        "failed": [
            {"run": row.label, "error": row.outcome.error} for row in rows if row.outcome.state == "failed"
        ],
        "failed_gates": failures,
        "groups": summary_document(groups),
    }
    write_tables(directory, rows, document, groups)
    return SweepResult(rows, groups, failures, document)
