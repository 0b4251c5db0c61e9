"""Runs a sweep and writes its tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

from gridslam.core.files import real_path
from gridslam.evaluation.gates import parse_gate
from gridslam.sweep.config import LogEntry, SweepConfig
from gridslam.sweep.contents import Hashes
from gridslam.sweep.gates import SweepGate, failed_gates, meets
from gridslam.sweep.job_result import JobResult, RunRow
from gridslam.sweep.jobs import (
    RunJob,
    RunSettings,
    job_of_run,
    settings_of_sweep,
    simulation_folder,
    simulation_jobs,
)
from gridslam.sweep.records import Records, sweep_directory
from gridslam.sweep.summary import Group, summarize
from gridslam.sweep.tables import summary_document, write_tables
from gridslam.sweep.work import Job, Stop

Runner: TypeAlias = Callable[[Sequence[Job]], Iterator[tuple[int, JobResult]]]
Report: TypeAlias = Callable[[str], None]

NOT_RUN = JobResult("not run")


@dataclass(frozen=True, slots=True)
class SweepResult:
    """All runs in the order of the sweep file, their groups, and lines on the failed gates; `document` is summary.json."""

    rows: Sequence[RunRow]
    groups: Sequence[Group]
    failed_gates: Sequence[str]
    document: Mapping[str, Any]

    @property
    def failed(self) -> list[RunRow]:
        """The runs that failed."""
        return [row for row in self.rows if row.result.state == "failed"]

    @property
    def is_interrupted(self) -> bool:
        """Whether some runs were not started."""
        return any(row.result.state == "not run" for row in self.rows)


def run_sweep(
    sweep: SweepConfig,
    folder: Path,
    output: Path,
    run: Runner,
    report: Report,
    stop: Stop,
    gates: Sequence[SweepGate] = (),
) -> SweepResult:
    """Run the jobs that are not done yet, and write the tables.

    folder: Paths in the sweep file are relative to it.
    output: Directory of the sweep.
    run: Executes jobs (`run_locally`, `run_on_cluster`).
    report: Called with a line for each finished job.
    stop: Returns true to stop.
    gates: Gates in addition to those of the file.

    Raises ConfigError before the first job starts.
    """
    settings = settings_of_sweep(sweep, folder)
    directory, hashes = real_path(output), Hashes()
    worlds = list(simulation_jobs(sweep, folder, directory, hashes))
    combinations = list(product(sweep.logs, settings))
    # Jobs on existing logs are created first, so that their errors are reported before any simulation.
    planned = {
        index: job_of_run(sweep, folder, output=directory, entry=entry, settings=run_settings, hashes=hashes)
        for index, (entry, run_settings) in enumerate(combinations)
        if entry.world is None
    }
    with sweep_directory(directory):
        work = _Work(Records(directory), run, report, stop)
        simulation_results = dict(zip([job.directory for job in worlds], work.results(worlds), strict=True))
        without_log: dict[int, JobResult] = {}
        for index, (entry, run_settings) in enumerate(combinations):
            if entry.world is None:
                continue
            simulation = simulation_results[simulation_folder(directory, entry.label, run_settings.seed)]
            if simulation.state != "done":
                without_log[index] = _without_log(simulation)
            else:
                planned[index] = job_of_run(
                    sweep, folder, output=directory, entry=entry, settings=run_settings, hashes=hashes
                )
        results = (
            dict(zip(sorted(planned), work.results([planned[i] for i in sorted(planned)]), strict=True))
            | without_log
        )
        rows = [
            _row(sweep, entry, run_settings, results[i])
            for i, (entry, run_settings) in enumerate(combinations)
        ]
        return _finish(sweep, directory, rows, [*sweep.gates(), *gates])


@dataclass(frozen=True, slots=True)
class _Work:
    """Runs jobs and records their results; recorded jobs are not repeated."""

    records: Records
    run: Runner
    report: Report
    stop: Stop

    def results(self, jobs: Sequence[Job]) -> list[JobResult]:
        found = [self.records.result(job) for job in jobs]
        remaining = [self._prepared(job) for job, result in zip(jobs, found, strict=True) if result is None]
        places = [place for place, result in enumerate(found) if result is None]
        if len(remaining) < len(jobs):
            self.report(f"{len(jobs) - len(remaining)} of {len(jobs)} are already done")
        if remaining and not self.stop():
            for count, (place, result) in enumerate(self.run(remaining), start=1):
                self.records.write(remaining[place], result)
                found[places[place]] = result
                self.report(f"{count}/{len(remaining)} {remaining[place].label}: {_describe(result)}")
        return [NOT_RUN if result is None else result for result in found]

    def _prepared(self, job: Job) -> Job:
        return replace(job, is_made=self.records.is_made(job)) if isinstance(job, RunJob) else job


def _describe(result: JobResult) -> str:
    return f"{result.cost['wall_s']:.1f} s" if result.state == "done" else f"failed: {result.error}"


def _without_log(simulation: JobResult) -> JobResult:
    """The result of a run whose log was not simulated."""
    if simulation.state == "not run":
        return NOT_RUN
    return JobResult("failed", f"the simulation of its log failed: {simulation.error}")


def _row(sweep: SweepConfig, entry: LogEntry, settings: RunSettings, result: JobResult) -> RunRow:
    measures = dict(result.measures)
    if result.state == "done":
        for name, bounds in sweep.successes.items():
            measures[f"success.{name}"] = meets([parse_gate(text) for text in bounds], result.measures)
    return RunRow(
        entry.label,
        settings.config,
        override=settings.override,
        seed=settings.seed,
        result=result,
        measures=measures,
    )


def _finish(
    sweep: SweepConfig, directory: Path, rows: list[RunRow], gates: Sequence[SweepGate]
) -> SweepResult:
    groups = summarize(rows, [f"success.{name}" for name in sweep.successes])
    failures = failed_gates(gates, rows, groups)
    states = [row.result.state for row in rows]
    document = {
        "command": sweep.command,
        "status": "interrupted" if "not run" in states else "complete",
        "runs": {state.replace(" ", "_"): states.count(state) for state in ("done", "failed", "not run")},
        "failed": [
            {"run": row.label, "error": row.result.error} for row in rows if row.result.state == "failed"
        ],
        "failed_gates": failures,
        "groups": summary_document(groups),
    }
    write_tables(directory, rows, document, groups)
    return SweepResult(rows, groups, failures, document)
