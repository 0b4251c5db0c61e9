"""Executes one job of a sweep in the current process."""

from __future__ import annotations

import shutil
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from gridslam.core.errors import GridslamError, MethodError
from gridslam.sweep.contents import program_key
from gridslam.sweep.job_result import JobResult
from gridslam.sweep.jobs import RunJob, SimulateJob

Job: TypeAlias = RunJob | SimulateJob
Stop: TypeAlias = Callable[[], bool]


def execute(job: Job, stop: Stop) -> JobResult:
    """Run a job and return its result; an error fails only this job. `stop` returns true to interrupt it.

    The process runs one job at a time. Of all exceptions, only KeyboardInterrupt is passed on.
    """
    from gridslam.report.environment import peak_memory_mb, restart_peak_memory

    restart_peak_memory()
    started, cpu = time.perf_counter(), time.process_time()
    try:
        if job.program != program_key():
            raise MethodError(
                "this worker has another version of gridslam or its libraries than the process of the sweep"
            )
        done = _simulate(job) if isinstance(job, SimulateJob) else _run(job, stop)
    except GridslamError as error:
        return JobResult("failed", " ".join(str(error).split()))
    except MemoryError:
        return JobResult("failed", "out of memory: use coarser cells, fewer particles or fewer jobs")
    except OSError as error:
        return JobResult("failed", f"{error.filename or 'output'}: {error.strerror or error}")
    except Exception as error:  # the error boundary of a job, as cli.main is that of a command
        frames = traceback.extract_tb(error.__traceback__)
        place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
        text = " ".join(str(error).split())
        return JobResult("failed", f"internal error, please report it: {type(error).__name__}: {text}{place}")
    cost = {
        "wall_s": time.perf_counter() - started,
        "cpu_s": time.process_time() - cpu,
        "peak_mb": peak_memory_mb(),
    }
    return JobResult("done", measures=done.measures, cost={**cost, **done.cost})


def _simulate(job: SimulateJob) -> JobResult:
    """Write log.mcap and log.truth/ into the job's directory, which appears when both are complete."""
    from gridslam.simulation.record import record_world
    from gridslam.simulation.world_config import validate_world

    world = validate_world(job.world, job.label)
    parent = job.directory.parent
    parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{job.directory.name}.", suffix=".partial", dir=parent))
    try:
        record_world(world, job.world_folder, temporary / "log.mcap")
        shutil.rmtree(job.directory, ignore_errors=True)
        temporary.replace(job.directory)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    return JobResult("done")


def _run(job: RunJob, stop: Stop) -> JobResult:
    cost = {} if job.is_made else _make(job, stop)
    return JobResult("done", measures=_measure(job), cost=cost)


def _make(job: RunJob, stop: Stop) -> dict[str, float]:
    """Write the run directory; returns the times (s) of reading and processing. Raises KeyboardInterrupt when stopped."""
    from gridslam.report.write import write_run
    from gridslam.runs.inputs import read_inputs
    from gridslam.runs.run import run_localize, run_map
    from gridslam.runs.run_config import validate_run_config

    config = validate_run_config(job.settings, job.label)
    inputs = read_inputs(job.inputs, config.method_name)
    if job.command == "map":
        run = run_map(config, job.log_path, lambda progress: None, stop, inputs)
    else:
        run = run_localize(
            config, job.log_path, map_path=job.map_path, show=lambda progress: None, stop=stop, inputs=inputs
        )
    if run.status == "interrupted":
        raise KeyboardInterrupt
    write_run(run, job.directory, force=True)
    return {"read_s": run.read_s, "process_s": run.process_s}


def _measure(job: RunJob) -> dict[str, float | int | bool | str | None]:
    """Measures by dotted key: facts of the report (`run.`), the method's measures (`method.`), errors against ground truth."""
    import json

    from gridslam.evaluation.document import evaluate, without_nan
    from gridslam.evaluation.gates import measures_of
    from gridslam.evaluation.inputs import EvaluationOptions
    from gridslam.evaluation.readers.from_files import load_result, load_truth
    from gridslam.report.directory import REPORT_NAME

    report = json.loads((job.directory / REPORT_NAME).read_bytes())
    path, skipped = report["trajectory"], report["counts"]["skipped_by_reason"]
    facts = {
        "status": report["status"],
        "trusted": report.get("doubt") is None,
        "poses": path["poses"],
        "length_m": path["length_m"],
    }
    measures = measures_of({"run": {**facts, "skipped": sum(skipped.values())}, "method": report["measures"]})
    if job.truth.is_there:
        options = job.options
        largest = options["max_difference_s"]
        files = job.truth
        truth = load_truth(files.truth, files.truth_map, files.relations, files.objects)
        measures |= measures_of(
            without_nan(
                evaluate(
                    load_result(job.directory, truth),
                    truth,
                    EvaluationOptions(
                        align=options["align"] or ("se2" if job.command == "map" else "none"),
                        sync=options["sync"],
                        max_difference_ns=None if largest is None else round(largest * 1e9),
                        max_gap_ns=round(options["max_gap_s"] * 1e9),
                        completeness_radius_m=options["completeness_radius_m"],
                        max_position_m=options["max_position_m"],
                        max_heading_deg=options["max_heading_deg"],
                    ),
                )
            )
        )
    return measures
