"""The work of `gridslam evaluate`: read, measure, print, write plots, check gates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gridslam.core.errors import ConfigError, GateError
from gridslam.core.stamps import END_S
from gridslam.evaluation import document as measures
from gridslam.evaluation.alignment import Align
from gridslam.evaluation.association import DEFAULT_MAX_GAP_NS, Sync
from gridslam.evaluation.gates import Gate, answers, check_keys, failures, measures_of, parse_gate
from gridslam.evaluation.headline import headline, text_of, unit_of
from gridslam.evaluation.inputs import EvaluationOptions, Result, Truth
from gridslam.evaluation.pose_errors import Delta, DeltaUnit
from gridslam.evaluation.pose_pairs import aligned_pairs
from gridslam.evaluation.readers.from_files import load_result, load_truth
from gridslam.evaluation.readers.run_files import read_consistency, run_command_of
from gridslam.evaluation.remarks.sanity import check_pairs, remarks_of

from . import console
from .interruption import finishing

TRUTH_FOLDER = "truth"  # written by `gridslam explore` into its run directory
MAX_DELTA = 1e9  # frames, metres or seconds
SHORT_DIGITS = 4  # significant digits of the short table


@dataclass(frozen=True, slots=True)
class TruthOptions:
    """Files and topic of the ground truth."""

    path: Path | None = None
    topic: str | None = None
    map_path: Path | None = None
    relations: Path | None = None
    objects: Path | None = None


@dataclass(frozen=True, slots=True)
class MeasureOptions:
    """Options of the command for the measures; None if the default depends on the input."""

    align: Align | None
    scale: bool
    sync: Sync
    max_difference_s: float | None
    max_gap_s: float | None
    time_offset_s: float
    delta: float
    delta_unit: DeltaUnit
    all_pairs: bool
    completeness_radius_m: float | None
    max_position_m: float
    max_heading_deg: float


@dataclass(frozen=True, slots=True)
class Request:
    """The command line of an evaluation."""

    paths: tuple[Path, ...]
    topic: str | None
    truth: TruthOptions
    measures: MeasureOptions
    require: tuple[str, ...]
    output: Path | None
    force: bool
    all_measures: bool
    as_json: bool


@dataclass(frozen=True, slots=True)
class _Evaluated:
    name: str
    path: Path
    result: Result
    truth: Truth
    options: EvaluationOptions
    document: dict[str, Any]


def run_evaluation(request: Request) -> None:
    """Evaluate all results, print and write. Raises GateError after the output if a gate fails."""
    gates = [parse_gate(text) for text in request.require]
    if request.output is not None:
        from gridslam.report.evaluation_page import check_evaluation_free

        truth = request.truth
        given = (truth.path, truth.map_path, truth.relations, truth.objects)
        read = [*request.paths, *(path for path in given if path is not None)]
        check_evaluation_free(request.output, request.force, read)
    evaluated = [_evaluated(request, path, name) for path, name in _named(request.paths)]
    for one in evaluated:
        check_keys(gates, one.document, measures.NEEDS)
    replies = [line for one in evaluated for line in _labelled(one, evaluated, answers(gates, one.document))]
    output = _output(evaluated)
    with finishing():
        if request.output is not None:
            _write(request, evaluated, output, replies)
        if request.as_json:
            console.emit_json(output)
        else:
            _show(evaluated, request.all_measures, replies)
            if request.output is not None:
                console.say(f"plots and measures are in {request.output / 'evaluation.html'}")
    _refuse_failed(evaluated, gates)


def _named(paths: Sequence[Path]) -> list[tuple[Path, str]]:
    """The results with the names that tables show: the last part of the path, or all of it where two are equal."""
    short = [path.name or str(path) for path in paths]
    return [
        (path, name if short.count(name) == 1 else str(path)) for path, name in zip(paths, short, strict=True)
    ]


def _evaluated(request: Request, path: Path, name: str) -> _Evaluated:
    where = request.truth
    truth_path = where.path
    if truth_path is None and (path / TRUTH_FOLDER).is_dir():
        truth_path = path / TRUTH_FOLDER
    has_truth = any((truth_path, where.map_path, where.relations, where.objects))
    if not has_truth and read_consistency(path) is None:
        raise ConfigError(
            "nothing to compare with: give --truth, --relations, --truth-map or --truth-objects"
        )
    if where.topic is not None and truth_path is None:
        raise ConfigError("--truth-topic: name the log with --truth")
    options = _options(path, request.measures)
    truth = load_truth(truth_path, where.map_path, where.relations, where.objects, topic=where.topic)
    result = load_result(path, truth, request.topic)
    check_pairs(result, truth, options)
    document = measures.evaluate(result, truth, options)
    if has_truth and not document.keys() - {"consistency"}:
        raise ConfigError(f"{path}: has nothing to compare with this ground truth")
    document["remarks"] = remarks_of(result, truth, options, document)
    return _Evaluated(name, path, result=result, truth=truth, options=options, document=document)


def _options(path: Path, given: MeasureOptions) -> EvaluationOptions:
    """The checked options. Raises ConfigError: a value is out of range, or two options do not go together."""
    align = given.align
    if align is None:
        align = "se2" if run_command_of(path) in ("map", "explore") else "none"
    if given.scale and align != "se2":
        raise ConfigError("--scale: only --align se2 estimates a scale")
    is_whole = given.delta_unit != "frames" or given.delta.is_integer()
    if not (0.0 < given.delta <= MAX_DELTA and is_whole):
        raise ConfigError(
            f"--delta {given.delta:g}: expected a positive number up to {MAX_DELTA:g}, a whole number of frames"
        )
    for name, seconds in (("--max-difference", given.max_difference_s), ("--max-gap", given.max_gap_s)):
        if seconds is not None and not seconds <= END_S:
            raise ConfigError(f"{name} {seconds:g}: expected seconds up to {END_S:g}")
    if given.max_gap_s is not None and given.sync != "interpolate":
        raise ConfigError(
            "--max-gap: only --sync interpolate has a gap; --max-difference bounds the nearest pose"
        )
    if not abs(given.time_offset_s) <= END_S:
        raise ConfigError(f"--time-offset {given.time_offset_s:g}: expected seconds up to {END_S:g}")
    return EvaluationOptions(
        align=align,
        with_scale=given.scale,
        sync=given.sync,
        max_difference_ns=None if given.max_difference_s is None else round(given.max_difference_s * 1e9),
        max_gap_ns=DEFAULT_MAX_GAP_NS if given.max_gap_s is None else round(given.max_gap_s * 1e9),
        time_offset_ns=round(given.time_offset_s * 1e9),
        delta=Delta(given.delta, given.delta_unit, given.all_pairs),
        completeness_radius_m=given.completeness_radius_m,
        max_position_m=given.max_position_m,
        max_heading_deg=given.max_heading_deg,
    )


def _output(evaluated: Sequence[_Evaluated]) -> dict[str, Any]:
    """The JSON document: that of the only result, or a list of all."""
    if len(evaluated) == 1:
        return measures.without_nan(evaluated[0].document)
    return {"results": [{"result": str(one.path), **measures.without_nan(one.document)} for one in evaluated]}


def _write(
    request: Request, evaluated: Sequence[_Evaluated], output: Mapping[str, Any], replies: Sequence[str]
) -> None:
    from gridslam.report.evaluation_page import write_evaluation
    from gridslam.report.figures.evaluation_plots import EvaluatedTrajectory

    assert request.output is not None
    trajectories = [
        EvaluatedTrajectory(
            one.name, aligned_pairs(one.result.trajectory, one.truth.trajectory, one.options)[0]
        )
        for one in evaluated
        if one.result.trajectory is not None and one.truth.trajectory is not None
    ]
    write_evaluation(
        request.output,
        documents={one.name: one.document for one in evaluated},
        trajectories=trajectories,
        truth=evaluated[0].truth.trajectory,
        output=output,
        answers=replies,
        force=request.force,
    )


def _show(evaluated: Sequence[_Evaluated], all_measures: bool, replies: Sequence[str]) -> None:
    """Print the table of measures, the remarks and the answers to gates."""
    flat = [measures_of(one.document) for one in evaluated]
    digits = 6 if all_measures else SHORT_DIGITS
    shown = (
        (list(values) for values in flat) if all_measures else (headline(one.document) for one in evaluated)
    )
    keys = list(dict.fromkeys(key for keys in shown for key in keys))
    names = [one.name for one in evaluated] if len(evaluated) > 1 else ["value"]
    rows = [(key, *(text_of(values.get(key), digits) for values in flat), unit_of(key)) for key in keys]
    console.emit_table(("measure", *names, "unit"), rows)
    left_out = len(dict.fromkeys(key for values in flat for key in values)) - len(keys)
    lines = [f"{left_out} more with --all"] if left_out > 0 else []
    for one in evaluated:
        lines += _labelled(one, evaluated, [f"remark: {line}" for line in one.document["remarks"]])
    if lines or replies:
        console.emit("\n".join([*lines, *replies]))


def _labelled(one: _Evaluated, evaluated: Sequence[_Evaluated], lines: Sequence[str]) -> list[str]:
    """The lines, each with the result's name where there are several."""
    return [f"{one.name}: {line}" for line in lines] if len(evaluated) > 1 else list(lines)


def _refuse_failed(evaluated: Sequence[_Evaluated], gates: Sequence[Gate]) -> None:
    failed = [line for one in evaluated for line in _labelled(one, evaluated, failures(gates, one.document))]
    for line in failed[:-1]:
        console.complain(f"error: {line}")
    if failed:
        raise GateError(failed[-1])
