"""Several logs of one place as one run: each continues the session of those before it."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from gridslam.core.errors import ConfigError
from gridslam.core.trajectory import Trajectory
from gridslam.methods import registry
from gridslam.runs.feed import Show, Stop
from gridslam.runs.inputs import NOTHING_MORE, Input
from gridslam.runs.run import Run, run_map
from gridslam.runs.run_config import RunConfig
from gridslam.runs.run_counts import StreamCount

SESSION = "session"


def run_map_logs(
    config: RunConfig[BaseModel],
    log_paths: Sequence[Path],
    show: Show,
    stop: Stop,
    inputs: Mapping[str, Input] = NOTHING_MORE,
) -> Run:
    """Map logs one after the other, each continuing the map of those before it.

    Returns the run of the last log, with the inputs, problems and times of all. Mapping each log in a run of its own with
    `--continue` gives the same result. Raises ConfigError: the method cannot continue a map.
    """
    entry = registry.METHODS[config.method_name]
    if len(log_paths) > 1 and not entry.is_continued:
        able = [name for name, e in registry.METHODS.items() if e.is_continued]
        raise ConfigError(
            f"{len(log_paths)} logs: {config.method_name} maps one log; methods that map several: {', '.join(able)}"
        )
    done: list[Run] = []
    for path in log_paths:
        run = run_map(config, path, show, stop, inputs)
        if done and run.status == "interrupted" and not run.result.files:  # before the log's first scan
            done[-1] = replace(done[-1], status="interrupted")
            break
        done.append(run)
        if run.status == "interrupted":
            break
        inputs = {**inputs, SESSION: _session_of(run)} if len(log_paths) > 1 else inputs
    return done[-1] if len(done) == 1 else _as_one(done)


def _session_of(run: Run) -> Input:
    """The session that a run has written, as an input of the next one."""
    kind = next(k for k in registry.METHODS[run.config.method_name].inputs if k.name == SESSION)
    content = run.result.files.get(kind.in_run)
    if content is None:
        raise ConfigError(
            "method.pose_graph.enabled: false, but several logs become one map by loop closure alone"
        )
    from gridslam.lidar_slam.sessions.session_file import read_session

    name = f"session of {run.log_path.name}"
    return Input(read_session(content, name), Path(kind.in_run), hashlib.sha256(content).hexdigest())


def _as_one(runs: Sequence[Run]) -> Run:
    """The last run with the inputs, problems, counts and times of all."""
    last = runs[-1]
    streams: dict[str, StreamCount] = {}
    for run in runs:
        for name, count in run.counts.streams.items():
            streams[name] = _added(streams[name], count) if name in streams else count
    inputs = {name: digest for run in runs for name, digest in run.inputs.items()}
    inputs.pop("session.npz", None)
    counts = replace(
        last.counts,
        streams=streams,
        skipped_by_reason=_sum([run.counts.skipped_by_reason for run in runs]),
        lost=_sum([run.counts.lost for run in runs]),
    )
    has_losses = any(run.status == "lossy" for run in runs)
    return replace(
        last,
        inputs=inputs,
        given={name: file for name, file in last.given.items() if name != SESSION},
        earlier_logs=tuple(run.log_path for run in runs[:-1]),
        truth=_truth_of(runs),
        status="lossy" if has_losses and last.status == "complete" else last.status,
        is_lossy=any(run.is_lossy for run in runs),
        problems=tuple(f"{run.log_path.name}: {problem}" for run in runs for problem in run.problems),
        counts=counts,
        read_s=sum(run.read_s for run in runs),
        process_s=sum(run.process_s for run in runs),
        compile_s=sum(run.compile_s for run in runs),
    )


def _truth_of(runs: Sequence[Run]) -> Trajectory | None:
    """The true poses of all logs if the trajectory has the poses of all, else those of the last log."""
    last = runs[-1]
    if last.result.measures["session"]["trajectory_of"] != "all drives":  # type: ignore[index]
        return last.truth
    known = [run.truth for run in runs if run.truth is not None]
    if len(known) < len(runs):
        return last.truth
    joint = Trajectory(np.concatenate([t.stamps_ns for t in known]), np.concatenate([t.poses for t in known]))
    return joint.sorted()


def _sum(parts: Sequence[Mapping[str, int]]) -> dict[str, int]:
    total: Counter[str] = Counter()
    for part in parts:
        total.update(part)
    return dict(sorted(total.items()))


def _added(one: StreamCount, other: StreamCount) -> StreamCount:
    return StreamCount(one.read + other.read, one.used + other.used, one.skipped + other.skipped)
