"""report.json: the facts of a run under stable keys."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import gridslam
from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.report.directory import REPORT_FORMAT
from gridslam.report.environment import made_with, peak_memory_mb
from gridslam.report.errors_over_time import errors_of
from gridslam.runs.run import Run

FORMAT_VERSION = 1
MIN_OCCUPIED = 0.65  # smallest probability of an occupied cell, as in map.yaml


def report_document(run: Run, write_s: float) -> dict[str, Any]:
    """The content of report.json; `write_s` is the time of writing (s). Only it and report.html have timings and memory."""
    return {
        "format": REPORT_FORMAT,
        "format_version": FORMAT_VERSION,
        "version": gridslam.__version__,
        "command": run.command,
        "method": run.config.method_name,
        "status": run.status,
        "doubt": None if run.result.doubt is None else run.result.doubt.reason,
        "seed": run.config.seed,
        "inputs": [{"path": name, "sha256": digest} for name, digest in sorted(run.inputs.items())],
        "log": {
            "path": str(run.log_path),
            "lossy": run.is_lossy,
            "problems": list(run.problems),
            "remarks": dict(run.counts.remarks),
        },
        "counts": {
            **{name: asdict(stream) for name, stream in run.counts.streams.items()},
            "skipped_by_reason": dict(run.counts.skipped_by_reason),
            "lost": dict(run.counts.lost),
        },
        "counters": dict(sorted(run.result.counters.items())),
        "timing": {
            "total_s": run.read_s + run.compile_s + run.process_s + write_s,
            "read_s": run.read_s,
            "compile_s": run.compile_s,
            "process_s": run.process_s,
            "write_s": write_s,
            "method": dict(run.result.timings_s),
        },
        "memory": {"peak_mb": peak_memory_mb()},
        "trajectory": trajectory_facts(run.result.trajectory),
        "map": map_facts(run),
        "errors": None if (errors := errors_of(run)) is None else errors.summary(),
        "measures": plain(run.result.measures),
        "made_with": made_with().model_dump(),
    }


def trajectory_facts(trajectory: Trajectory) -> dict[str, Any]:
    """Number of poses, path length (m), and first and last stamp (as text, since a float is not exact)."""
    if not len(trajectory):
        return {"poses": 0, "length_m": 0.0}
    steps = np.diff(trajectory.poses[:, :2], axis=0)
    return {
        "poses": len(trajectory),
        "length_m": float(np.hypot(steps[:, 0], steps[:, 1]).sum()),
        "first_stamp": format_stamp(int(trajectory.stamps_ns[0])),
        "last_stamp": format_stamp(int(trajectory.stamps_ns[-1])),
    }


def map_facts(run: Run) -> dict[str, Any] | None:
    """Size and known area of the map; None for a run without a map."""
    grid = run.result.occupancy
    if grid is None:
        return None
    rows, cols = grid.probability.shape
    known = ~np.isnan(grid.probability)
    cell_m2 = grid.geometry.resolution_m**2
    return {
        "rows": rows,
        "cols": cols,
        "resolution_m": grid.geometry.resolution_m,
        "known_m2": float(known.sum() * cell_m2),
        "occupied_cells": int((grid.probability[known] >= MIN_OCCUPIED).sum()),
    }


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """The document as UTF-8 JSON, with null for NaN and infinities."""
    text = json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode(errors="backslashreplace")  # file names may have bytes that are not text


def plain(value: Any) -> Any:
    """The value in JSON types: numpy scalars and arrays converted, NaN and infinities as None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (str, int)) or value is None:
        return value
    if isinstance(value, Sequence):
        return [plain(item) for item in value]
    return str(value)
