"""Records of finished jobs: one small file per job, written when it ends."""

from __future__ import annotations

import fcntl
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gridslam.core.errors import ConfigError
from gridslam.core.files import write_atomic
from gridslam.core.plain_files import MAX_JSON_BYTES, read_plain_file
from gridslam.core.texts import is_storable
from gridslam.report.directory import is_run_directory
from gridslam.report.document import json_bytes
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.jobs import RunJob, SimulateJob

MARKER, FORMAT, VERSION = "sweep.json", "gridslam sweep", 1
MAX_MEASURE = 1e150  # largest value that is read, so that its square is finite


@contextmanager
def sweep_directory(path: Path) -> Iterator[Path]:
    """Create or open the directory of a sweep and lock it for this process.

    Raises ConfigError if it exists and is not a sweep directory, is not writable, or is in use by another sweep.
    """
    try:
        if path.exists() and (not path.is_dir() or (any(path.iterdir()) and not _is_sweep(path))):
            raise ConfigError(
                f"{path}: exists and is not the directory of a sweep; choose another output folder"
            )
        path.mkdir(parents=True, exist_ok=True)
        write_atomic(path / MARKER, json_bytes({"format": FORMAT, "format_version": VERSION}))
        lock = (path / ".lock").open("w")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror})") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ConfigError(f"{path}: another sweep is using it; wait until it ends") from None
        _remove_unfinished(path)
        yield path


def _is_sweep(path: Path) -> bool:
    try:
        document = json.loads(read_plain_file(path / MARKER, MAX_JSON_BYTES))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.get("format") == FORMAT


def _remove_unfinished(path: Path) -> None:
    """Remove folders left by killed processes."""
    for part in ("runs", "logs"):
        for pattern in (".*.partial", ".*.old"):
            for folder in (path / part).rglob(pattern):
                shutil.rmtree(folder, ignore_errors=True)


class Records:
    """The records of one sweep directory."""

    def __init__(self, output: Path) -> None:
        self._folder = output / "records"

    def result(self, job: RunJob | SimulateJob) -> JobResult | None:
        """The recorded result of a job; None if the job has to run. Failed jobs are not recorded."""
        record = self._read(job)
        if record.get("evaluation_key") != _evaluation_key(job) or not job.directory.is_dir():
            return None
        return JobResult("done", measures=record["measures"], cost=record["cost"])

    def is_made(self, job: RunJob) -> bool:
        """Whether the run directory is complete and only has to be evaluated again."""
        return self._read(job).get("key") == job.key and is_run_directory(job.directory)

    def write(self, job: RunJob | SimulateJob, result: JobResult) -> None:
        """Record the result of a job; the record of a failed job is removed."""
        path = self._path(job)
        if result.state != "done":
            path.unlink(missing_ok=True)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        document = {"key": job.key, "evaluation_key": _evaluation_key(job), "label": job.label}
        write_atomic(path, json_bytes({**document, "measures": result.measures, "cost": result.cost}))

    def _path(self, job: RunJob | SimulateJob) -> Path:
        return self._folder / job.directory.relative_to(self._folder.parent).with_suffix(".json")

    def _read(self, job: RunJob | SimulateJob) -> dict[str, Any]:
        """The record; empty if it is missing or unreadable."""
        try:
            document = json.loads(read_plain_file(self._path(job), MAX_JSON_BYTES))
        except (OSError, ValueError, RecursionError):
            return {}
        is_whole = isinstance(document, dict) and all(
            isinstance(document.get(k), kind)
            for k, kind in (("key", str), ("evaluation_key", str), ("measures", dict), ("cost", dict))
        )
        if not is_whole or not all(map(_is_measure, document["measures"].items())):
            return {}
        return document if all(map(_is_measure, document["cost"].items())) else {}


def _evaluation_key(job: RunJob | SimulateJob) -> str:
    """The hash of everything that the recorded result depends on."""
    return job.evaluation_key if isinstance(job, RunJob) else job.key


def _is_measure(item: tuple[str, object]) -> bool:
    """Whether a name and its value can be written to tables."""
    name, value = item
    is_number = isinstance(value, bool | int | float) and abs(value) <= MAX_MEASURE
    return is_storable(name) and (
        value is None or is_number or (isinstance(value, str) and is_storable(value))
    )
