"""One run: passes the events of a log to a method and collects the result."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from pydantic import BaseModel

from gridslam.core.errors import ConfigError
from gridslam.core.memory import return_freed_memory, take_large_arrays_from_the_system
from gridslam.core.plain_files import sha256_of
from gridslam.core.trajectory import Trajectory
from gridslam.logs.open import open_log
from gridslam.logs.requirements import require_streams
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods import registry
from gridslam.methods.base import Method, RunResult
from gridslam.methods.packaged import PackagedMethod, naming
from gridslam.methods.particle_history import ParticleHistory, Snapshot
from gridslam.runs.feed import Progress, Show, Stop, feed
from gridslam.runs.inputs import NOTHING_MORE, Input, refuse_missing_inputs, refuse_unknown_inputs
from gridslam.runs.result_checks import (
    refuse_empty_result,
    unused_stream_line,
    unused_streams,
)
from gridslam.runs.result_types import refuse_wrong_result
from gridslam.runs.run_config import RunConfig
from gridslam.runs.run_counts import Counts, merge_counts

Status = Literal["complete", "interrupted", "lossy", "lost", "inconsistent", "apart"]
Command = Literal["map", "localize", "explore"]
MAX_LOCALIZED_CELLS = 64_000_000  # largest given map, 400 m x 400 m at 5 cm; each cell takes some 30 bytes


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run with everything that its report needs."""

    command: Command
    config: RunConfig[BaseModel]
    log_path: Path
    inputs: Mapping[str, str]  # file -> sha256
    result: RunResult
    occupancy: OccupancyGrid | None  # the built map, or the given one when localizing
    truth: Trajectory | None
    status: Status
    is_lossy: bool
    problems: tuple[str, ...]
    counts: Counts
    read_s: float
    process_s: float
    compile_s: float = 0.0  # compilation of kernels that were not cached; not part of the other times
    given: Mapping[str, str] = field(default_factory=dict)  # input, or "map" -> name of its file
    earlier_logs: tuple[Path, ...] = ()  # mapped before `log_path`, as one map
    particles: tuple[Snapshot, ...] = ()  # recorded for the viewer log
    odometry: Trajectory = field(default_factory=Trajectory.empty)  # thinned, in the odometry's frame


def run_map(
    config: RunConfig[BaseModel],
    log_path: Path,
    show: Show,
    stop: Stop,
    inputs: Mapping[str, Input] = NOTHING_MORE,
) -> Run:
    """Map a log. `show` is called with the progress after each batch; once `stop` returns true, the run ends early.

    `inputs` are those of the method's registry entry, by name (a drawing, a tag database).
    Raises ConfigError: the method does not map. LogError: the log is unreadable or lacks a stream.
    """
    return _run("map", config, log_path=log_path, occupancy=None, show=show, stop=stop, further=inputs)


def run_localize(
    config: RunConfig[BaseModel],
    log_path: Path,
    map_path: Path | None,
    show: Show,
    stop: Stop,
    inputs: Mapping[str, Input] = NOTHING_MORE,
) -> Run:
    """Localize along the log at `log_path` on a map (map_server YAML or wean.dat at `map_path`).

    `config`, `show`, `stop` and `inputs` are those of `run_map`.
    Raises MapError: the map is unreadable. ConfigError: there is none, and the method needs one.
    """
    if map_path is None:
        if not registry.METHODS[config.method_name].localizes_without_map:
            raise ConfigError(f"--map: {config.method_name} localizes on a map: name its YAML")
        return _run(
            "localize", config, log_path=log_path, occupancy=None, show=show, stop=stop, further=inputs
        )
    run = _run(
        "localize",
        config,
        log_path=log_path,
        occupancy=load_any_map(map_path, MAX_LOCALIZED_CELLS),
        show=show,
        stop=stop,
        further=inputs,
    )
    digest = sha256_of(map_path)
    return replace(
        run, inputs={**run.inputs, map_path.name: digest}, given={"map": map_path.name, **run.given}
    )


def _run(
    command: Command,
    config: RunConfig[BaseModel],
    log_path: Path,
    occupancy: OccupancyGrid | None,
    show: Show,
    stop: Stop,
    further: Mapping[str, Input],
) -> Run:
    # This imports numba, which the checks before a run do not need.
    from gridslam.kernels.compiling import timing_compilation

    take_large_arrays_from_the_system()
    started = time.perf_counter()
    build = method_builder(command, config)
    entry = registry.METHODS[config.method_name]
    refuse_unknown_inputs(config.method_name, further)
    refuse_missing_inputs(config.method_name, further)
    with timing_compilation() as clock, open_log(log_path, config.log, entry.reads) as log:
        require_streams(log, entry.needs)
        truth = log.truth()  # first, so that its errors are reported before the log is processed
        method = _built_method(build, config, log_path, occupancy, further)
        opened = clock.now()
        history = ParticleHistory(method) if config.output.viewer else None
        fed = feed(log, history or method, show, stop, clock.now)
        log.close()  # frees the messages kept in memory
        return_freed_memory()
        show(Progress(fed.events, fed.events, fed.scans, is_finishing=True))
        before_result = clock.now()
        result = method.result()
        package = registry.package_of(config.method_name)
        refuse_wrong_result(package or config.method_name, result, is_packaged=bool(package))
        finished = clock.now()
        interrupted = fed.stopped or stop()
        counts = merge_counts(log.counters, result.counters)
        if not interrupted:
            refuse_empty_result(config.method_name, log_path, result, counts, log.problems)
        missing = set(entry.input_names) - further.keys()
        unused = unused_streams(counts)
        is_lossy = log.is_lossy or not missing.issuperset(unused)
        unused_lines = [unused_stream_line(name, counts, missing) for name in unused]
        return Run(
            command=command,
            config=config,
            log_path=log_path,
            inputs={**log.input_hashes(), **{i.path.name: i.sha256 for i in further.values()}},
            result=result,
            occupancy=result.occupancy if occupancy is None else occupancy,
            truth=truth if truth is not None and len(truth) else None,
            status=status_of(result, is_interrupted=interrupted, is_lossy=is_lossy),
            is_lossy=is_lossy or log.has_findings or bool(result.notes),
            problems=(*log.problems, *result.notes, *unused_lines),
            counts=counts,
            read_s=opened - started + fed.read_s + clock.now() - finished,
            process_s=fed.process_s + finished - before_result,
            compile_s=clock.seconds,
            given={name: i.path.name for name, i in further.items()},
            particles=history.snapshots if history else (),
            odometry=fed.odometry.trajectory(),
        )


def _built_method(
    build: Callable[..., Method],
    config: RunConfig[BaseModel],
    log_path: Path,
    occupancy: OccupancyGrid | None,
    further: Mapping[str, Input],
) -> Method:
    """The method with its inputs; errors of a method in another package name the package."""
    given = () if occupancy is None else (occupancy,)
    values = {name: item.value for name, item in further.items()}
    if registry.METHODS[config.method_name].is_continued:
        values["log_name"] = log_path.name
    package = registry.package_of(config.method_name)
    with naming(package):
        method = build(config.method, config.seed, *given, **values)
    return PackagedMethod(method, package) if package else method


def status_of(result: RunResult, *, is_interrupted: bool, is_lossy: bool) -> Status:
    """The status of a run: the first that applies of interrupted, the method's doubt, lossy, and complete."""
    if is_interrupted:
        return "interrupted"
    if result.doubt is not None:
        return result.doubt.status
    return "lossy" if is_lossy else "complete"


def method_builder(command: Command, config: RunConfig[BaseModel]) -> Callable[..., Method]:
    """The class of a config's method for a command. Raises ConfigError: the method does not support the command."""
    name = config.method_name
    entry = registry.METHODS[name]
    reference = entry.mapper if command == "map" else entry.localizer
    if not reference:
        able = [n for n, e in registry.METHODS.items() if (e.mapper if command == "map" else e.localizer)]
        raise ConfigError(
            f"method.name: {name} has no `gridslam {command}`; methods that have: {', '.join(able)}"
        )
    with naming(registry.package_of(name)):
        builder: Callable[..., Method] = registry.load(reference)
    return builder
