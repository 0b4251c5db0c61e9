"""Shared by `map` and `localize`: options, the run, its directory, the summary on stdout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import typer
from pydantic import BaseModel

from gridslam.api import localize, map_log
from gridslam.core.errors import ConfigError
from gridslam.core.nested import flatten
from gridslam.core.threads import limit_threads
from gridslam.core.trajectory import Trajectory
from gridslam.maps.load import map_files
from gridslam.methods.registry import BUILT_IN
from gridslam.report.directory import check_free
from gridslam.report.environment import made_with
from gridslam.report.run_yaml import FILE_NAME as RUN_YAML
from gridslam.report.sensor_trust import sensor_summary
from gridslam.report.write import write_run
from gridslam.runs.feed import Stop
from gridslam.runs.run import Command, Run
from gridslam.runs.run_config import RunConfig, load_config

from . import console
from .coordinates import coordinates
from .interruption import finishing, stop_on_signals

LOSSY, DOUBTFUL, INTERRUPTED = 3, 5, 130
MAX_PROBLEMS = 10


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options of a run."""

    log: Path
    config: str
    output: Path
    overrides: tuple[str, ...]
    seed: int | None
    jobs: int | None
    force: bool
    strict: bool
    as_json: bool
    inputs: Mapping[str, Path] = field(default_factory=dict)
    earlier: tuple[Path, ...] = ()  # logs that are mapped before `log`
    truth: Path | None = None
    truth_topic: str | None = None


def run_command(command: Command, options: RunOptions, map_path: Path | None = None) -> None:
    """Run, write the directory, print the summary. Exits with 130 if interrupted; with --strict 5 if doubtful, 3 if lossy."""
    before = check_free(options.output, options.force, _files_read(options, map_path))
    config = load_config(options.config, options.overrides, options.seed)
    _warn_of_other_versions(config)
    if options.jobs is not None:
        limit_threads(options.jobs)
    truth = _read_truth(options)
    with stop_on_signals() as stop:
        run = _run(command, config, options, map_path, stop)
        if truth is not None:
            run = replace(run, truth=truth)
        _print_problems(run)
        if run.result.doubt is not None and run.status != "interrupted":
            console.say(f"warning: {run.status}: {run.result.doubt.reason}")
        document = write_run(run, options.output, options.force, before=before)
    with finishing():
        if options.as_json:
            console.emit_json(document)
        else:
            console.emit_table(("", ""), summary(run, document, options.output))
    _exit_unless_complete(run, options)


def _files_read(options: RunOptions, map_path: Path | None) -> list[Path]:
    """The inputs of a run, which its output may not replace.

    Its config is one as well, but the run.yaml of an earlier run may be replaced together with that run.
    """
    config = Path(options.config)
    files = [options.log, *options.earlier, *options.inputs.values()]
    files += [path for path in (map_path, options.truth) if path is not None]
    if map_path is not None and map_path.is_file():
        files += map_files(map_path)
    return [*files, config] if config.is_file() and config.name != RUN_YAML else files


def _read_truth(options: RunOptions) -> Trajectory | None:
    """The true poses that the command line names, read before the run. Raises ConfigError or InputError."""
    if options.truth is None:
        if options.truth_topic is not None:
            raise ConfigError("--truth-topic: name the log with --truth")
        return None
    from gridslam.evaluation.readers.from_files import load_truth

    truth = load_truth(options.truth, topic=options.truth_topic).trajectory
    if truth is None:
        raise ConfigError(f"--truth {options.truth}: has no true poses")
    return truth


def _run(
    command: Command, config: RunConfig[BaseModel], options: RunOptions, map_path: Path | None, stop: Stop
) -> Run:
    """The run, with a progress bar and a notice if kernels have to be compiled first."""
    from gridslam.kernels.compiling import announcing_compilation  # imports numba: not before the checks

    def notify() -> None:
        console.say("compiling kernels, once per installation: about a minute")

    with console.progress_bar(command) as show, announcing_compilation(notify):
        if command == "map":
            done = map_log(
                [*options.earlier, options.log], config, inputs=options.inputs, progress=show, stop=stop
            )
        else:
            done = localize(options.log, map_path, config, inputs=options.inputs, progress=show, stop=stop)
        return done.run


def _warn_of_other_versions(config: RunConfig[BaseModel]) -> None:
    """Warn if a run.yaml was written with other versions: results may then differ."""
    if config.made_with is None or config.made_with == (present := made_with()):
        return
    recorded, now = (dict(flatten(m.model_dump())) for m in (config.made_with, present))
    differing = sorted(key for key in recorded.keys() | now.keys() if recorded.get(key) != now.get(key))
    changes = ", ".join(f"{key} {recorded.get(key, '-')}, now {now.get(key, '-')}" for key in differing)
    console.say(f"warning: the config was written with other versions ({changes}): the result may differ")


def _print_problems(run: Run) -> None:
    for problem in run.problems[:MAX_PROBLEMS]:
        console.say(f"{run.log_path}: {problem}")
    if len(run.problems) > MAX_PROBLEMS:
        console.say(f"{run.log_path}: and {len(run.problems) - MAX_PROBLEMS} more in report.json")


def _exit_unless_complete(run: Run, options: RunOptions) -> None:
    if run.status == "interrupted":
        console.complain(f"interrupted: {options.output} has the result so far")
        raise typer.Exit(INTERRUPTED)
    if run.result.doubt is not None and options.strict:
        console.complain(f"error: {options.output}: the result is {run.status}, which --strict forbids")
        raise typer.Exit(DOUBTFUL)
    if run.is_lossy and options.strict:
        console.complain(
            f"error: {run.log_path}: not all of the log could be used as recorded, which --strict forbids; "
            "report.json says why"
        )
        raise typer.Exit(LOSSY)


def summary(run: Run, document: dict[str, Any], output: Path) -> list[tuple[str, str]]:
    """Rows of the summary that is printed after a run."""
    path, timing = document["trajectory"], document["timing"]
    rows = [
        ("status", run.status),
        ("trajectory", f"{path['poses']} poses, {path['length_m']:.1f} m"),
    ]
    if run.result.doubt is not None:
        rows.insert(1, ("doubt", run.result.doubt.reason))
    if (facts := document["map"]) is not None:
        cells = f"{facts['cols']} x {facts['rows']} cells of {facts['resolution_m'] * 100:g} cm"
        rows.append(("map", f"{cells}, {facts['known_m2']:.0f} m2 known"))
    if (errors := document["errors"]) is not None:
        ape, aligned_m = errors["ape"], errors["aligned_rmse_m"]
        text = f"{ape['trans']['rmse']:.3f} m, {ape['rot']['rmse']:.2f} deg (rmse against ground truth)"
        if aligned_m is not None:
            text += f"; {aligned_m:.3f} m after alignment, if the map's frame is not that of the truth"
        rows.append(("error", text))
    # A package's own measures mean anything
    measures = document["measures"] if run.config.method_name in BUILT_IN else {}
    if (sensors := sensor_summary(measures.get("motion", {}))) is not None:
        rows.append(("sensors", sensors))
    consistency = measures.get("map_consistency")
    if consistency is not None and not consistency["is_doubtful"]:  # else the row "doubt" says so
        rows.append(("consistency", consistency["summary"]))
    warp = measures.get("drawing", {}).get("warp", {})
    if warp.get("summary") and run.result.doubt is None:
        rows.append(("drawing", warp["summary"]))
    rows.append(("time", f"{timing['total_s']:.1f} s, {document['memory']['peak_mb']:.0f} MB"))
    if run.occupancy is not None and run.occupancy.probability.size:
        rows.append(("picture", str(output / "map.png")))
    rows.append(("report", str(output / ("report.html" if run.config.output.html else "report.json"))))
    return rows


def span_overrides(start_s: float | None, end_s: float | None) -> list[str]:
    """`--start S` and `--end S` as overrides of `log.start_s` and `log.end_s`."""
    given_s = {"start_s": start_s, "end_s": end_s}
    return [f"log.{name}={value!r}" for name, value in given_s.items() if value is not None]


def start_override(text: str, option: str = "--start") -> str:
    """`--start x,y,yaw` as an override of `method.start`."""
    form = f"x,y,yaw in metres and radians, for example {option} 1.5,-2,0.3"
    x, y, yaw = coordinates(option, text, (3,), form)
    return f"method.start=[{x!r}, {y!r}, {yaw!r}]"


def given(further: Sequence[str] | None = None, **paths: Path | None) -> dict[str, Path]:
    """The inputs of a command line by name: those with an option of their own, and texts `NAME=FILE` of `--input`.

    Raises ConfigError: a text is not of that form.
    """
    inputs = {name: path for name, path in paths.items() if path is not None}
    for text in further or ():
        name, equals, file = text.partition("=")
        if not (name and equals and file):
            raise ConfigError(f"--input {text}: expected NAME=FILE")
        inputs[name] = Path(file)
    return inputs
