"""The Python interface: maps, trajectories, errors and pictures from logs, as objects. `import gridslam` exports its names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import BaseModel

from gridslam.core.errors import ConfigError
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation import document as measures
from gridslam.evaluation.inputs import EvaluationOptions, Result
from gridslam.evaluation.readers.files import read_trajectory
from gridslam.evaluation.readers.from_files import load_result, load_truth
from gridslam.evaluation.readers.run_files import run_command_of
from gridslam.logs.config import LogConfig
from gridslam.logs.log import Log
from gridslam.maps.load import load_any_map
from gridslam.maps.map_server import save_map as save_map_files
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.methods.base import Doubt, Table
from gridslam.report.document import report_document
from gridslam.report.write import write_run
from gridslam.runs.feed import Show, Stop
from gridslam.runs.inputs import read_inputs
from gridslam.runs.run import Run, run_localize
from gridslam.runs.run_config import ConfigSource, RunConfig, load_config
from gridslam.runs.several_logs import run_map_logs

if TYPE_CHECKING:
    from gridslam.lidar_slam.sessions.session import Session

AnyPath: TypeAlias = str | PathLike[str]
AnyLog: TypeAlias = str | PathLike[str] | Log
NO_SETTINGS: Mapping[str, object] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A finished run as objects; `save` writes its run directory. `run` is internal: its attributes may change."""

    run: Run

    @property
    def status(self) -> str:
        """The status of report.json.

        `complete`; `lossy`: not all of the log could be used; `interrupted`: stopped before its end. A method that doubts its
        own result sets `lost`, `inconsistent` or `apart`, and gives the reason in `doubt`.
        """
        return self.run.status

    @property
    def doubt(self) -> Doubt | None:
        """The method's reason not to trust its result; None if it has none."""
        return self.run.result.doubt

    @property
    def problems(self) -> Sequence[str]:
        """Lines about the log and the run: what was lost, assumed or repaired."""
        return self.run.problems

    @property
    def map(self) -> OccupancyGrid | None:
        """The map that was built or, after `localize`, the given map; None if there is none."""
        return self.run.occupancy

    @property
    def trajectory(self) -> Trajectory:
        """T_map_base over time; empty if no pose was found."""
        return self.run.result.trajectory

    @property
    def layers(self) -> Mapping[str, NDArray[np.generic]]:
        """The method's additional layers by name, each `(rows, cols)` from the lower left corner."""
        return {name: layer.values for name, layer in self.run.result.layers.items()}

    @property
    def tables(self) -> Mapping[str, Table]:
        """The method's tables by name; each is written as NAME.csv."""
        return self.run.result.tables

    @property
    def pictures(self) -> Mapping[str, Image.Image]:
        """`map` with the trajectory drawn on it, and the method's own pictures by name."""
        made = {name: Image.fromarray(picture.rgb) for name, picture in self.run.result.pictures.items()}
        if self.map is None or not self.map.probability.size:
            return made
        return {"map": render_map(self.map, self.trajectory), **made}

    @property
    def report(self) -> dict[str, Any]:
        """The document of report.json: errors where the truth is known, timing, memory, message counts."""
        return report_document(self.run, 0.0)

    def save(self, directory: AnyPath, *, force: bool = False) -> Path:
        """Write the run directory and return its path.

        Raises ConfigError: something is there already (`force` replaces a run directory), or it cannot be written.
        """
        write_run(self.run, Path(directory), force)
        return Path(directory)


def map_log(
    log: AnyLog | Sequence[AnyLog],
    config: ConfigSource,
    *,
    settings: Mapping[str, object] = NO_SETTINGS,
    drawing: AnyPath | None = None,
    tags: AnyPath | None = None,
    session: AnyPath | None = None,
    inputs: Mapping[str, AnyPath] | None = None,
    seed: int | None = None,
    progress: Show | None = None,
    stop: Stop | None = None,
    **keywords: object,
) -> FinishedRun:
    """Map a log, or several logs of one place into one map: `gridslam map` without writing any file.

    log: Paths of logs, or opened ones. An opened `Log` is read again from its path with the same settings; its counters and
        its playback are left as they are.
    config, settings: As for `load_config`.
    keywords: More settings, `particles=50`, unless a parameter has that name.
    drawing: Picture of the hand-drawn map (handmap-slam).
    tags: Tag database (slam-sd).
    session: Run directory or session.npz whose map is continued.
    inputs: Files for the inputs that a plug-in method declares, by name.
    seed: Replaces the seed of the configuration.
    progress: Called with a `Progress` after each batch of messages, which takes 10 to 40 ms.
    stop: Polled during the run; once it returns True, the run ends with the result so far.

    Raises ConfigError, LogError (unreadable, or a stream is missing), MethodError.
    """
    logs = [log] if isinstance(log, str | PathLike | Log) else list(log)
    loaded = _with_log_settings(load_config(config, (), seed, _joined(settings, keywords)), logs)
    paths = _given({"drawing": drawing, "tags": tags, "session": session, **(inputs or {})})
    contents = read_inputs(paths, loaded.method_name)
    run = run_map_logs(loaded, [_path_of(one) for one in logs], progress or _ignore, stop or _never, contents)
    return FinishedRun(run)


def localize(
    log: AnyLog,
    map_path: AnyPath | None,
    config: ConfigSource = "ispace-mcl",
    *,
    settings: Mapping[str, object] = NO_SETTINGS,
    drawing: AnyPath | None = None,
    tags: AnyPath | None = None,
    inputs: Mapping[str, AnyPath] | None = None,
    seed: int | None = None,
    progress: Show | None = None,
    stop: Stop | None = None,
    **keywords: object,
) -> FinishedRun:
    """Localize along a log on a map: `gridslam localize` without writing any file.

    `map_path` is a map_server YAML, wean.dat, or a run directory with a session (or its session.npz). With a session, the layer,
    table and picture `disagreement` show where the place has changed since. All other parameters are those of `map_log`.

    Raises MapError (the map is unreadable), and the errors of `map_log`.
    """
    loaded = _with_log_settings(load_config(config, (), seed, _joined(settings, keywords)), [log])
    given_map = None if map_path is None else Path(map_path)
    session = None
    if given_map is not None and (given_map.is_dir() or given_map.suffix == ".npz"):
        session, given_map = _session_and_map(given_map)
    contents = read_inputs(_given({"drawing": drawing, "tags": tags, **(inputs or {})}), loaded.method_name)
    run = run_localize(
        loaded,
        _path_of(log),
        map_path=given_map,
        show=progress or _ignore,
        stop=stop or _never,
        inputs=contents,
    )
    if session is not None and run.status != "interrupted":
        from gridslam.runs.session_disagreement import with_disagreement

        run = with_disagreement(run, session)
    return FinishedRun(run)


def _joined(settings: Mapping[str, object], keywords: Mapping[str, object]) -> Mapping[str, object]:
    """The settings together with those given by keyword. Raises ConfigError: a key is in both."""
    for key in settings.keys() & keywords.keys():
        raise ConfigError(f"method.{key}: is given in `settings` and as a keyword")
    return {**settings, **keywords}


def _path_of(log: AnyLog) -> Path:
    return log.path if isinstance(log, Log) else Path(log)


def _with_log_settings(config: RunConfig[BaseModel], logs: Sequence[AnyLog]) -> RunConfig[BaseModel]:
    """The configuration, with the settings for logs replaced by those with which the `Log` objects were opened.

    Raises ConfigError: the configuration has other settings for logs, or the logs were opened with different ones.
    """
    opened = [log for log in logs if isinstance(log, Log)]
    for log in opened:
        if config.log not in (LogConfig(), log.config) or log.config != opened[0].config:
            raise ConfigError(f"log: {log.path} was opened with other settings; give the log's path instead")
        config = config.model_copy(update={"log": log.config})
    return config


def _session_and_map(path: Path) -> tuple[Session, Path]:
    """The session of a run directory or of its session.npz, and the path of the map beside it. Raises InputError: no session."""
    from gridslam.lidar_slam.sessions.session_file import FILE_NAME, load_session

    file = path / FILE_NAME if path.is_dir() else path
    return load_session(file), file.with_name("map.yaml")


def simulate(world: AnyPath, log: AnyPath, *, overrides: Sequence[str] = (), force: bool = False) -> Path:
    """Record a simulated drive through a built-in world or a world file. Returns the path of the log.

    The ground truth is written beside the log. `overrides` are strings `KEY=VALUE` for keys of the world file.

    Raises ConfigError: the world is wrong, or the log exists already (`force` replaces it).
    """
    from gridslam.simulation.record import record_world
    from gridslam.simulation.world_config import load_world

    loaded, path = load_world(str(world), tuple(overrides))
    record_world(loaded, path.parent, Path(log), force=force)
    return Path(log)


def evaluate(
    result: FinishedRun | AnyPath,
    truth: AnyPath | None = None,
    *,
    truth_map: AnyPath | None = None,
    truth_objects: AnyPath | None = None,
    relations: AnyPath | None = None,
    options: EvaluationOptions | None = None,
) -> dict[str, Any]:
    """Measure a result against the truth: the document of `gridslam evaluate --json`, with NaN where JSON has null.

    `result` is a finished run, a run directory or a trajectory file. The truth files have the formats that the command reads.
    Without `options`, the result of a mapping run is aligned to the truth (`se2`), and any other is compared as it is.

    Raises InputError: a file is unreadable, or there is no truth for any part of the result.
    """
    true = load_truth(*(None if p is None else Path(p) for p in (truth, truth_map, relations, truth_objects)))
    if isinstance(result, FinishedRun):
        found = Result(trajectory=result.trajectory, occupancy=result.map)
        is_mapped = result.run.command != "localize"
    else:
        found = load_result(Path(result), true)
        is_mapped = run_command_of(Path(result)) in ("map", "explore")
    if options is None:
        options = replace(EvaluationOptions(), align="se2" if is_mapped else "none")
    return measures.evaluate(found, true, options)


def load_map(path: AnyPath) -> OccupancyGrid:
    """The map of a map_server YAML (or wean.dat). Raises MapError: it is unreadable."""
    return load_any_map(Path(path))


def save_map(grid: OccupancyGrid, path: AnyPath) -> None:
    """Write PATH.pgm and PATH.yaml for map_server; a suffix .yaml or .pgm of `path` is removed first."""
    given = Path(path)
    save_map_files(grid, given.with_suffix("") if given.suffix in (".yaml", ".pgm") else given)


def load_trajectory(path: AnyPath) -> Trajectory:
    """The trajectory of a TUM file, or of lines `t x y yaw`. Raises InputError: a line is wrong."""
    return read_trajectory(Path(path))


def _given(paths: Mapping[str, AnyPath | None]) -> dict[str, Path]:
    """The paths that are not None."""
    return {name: Path(path) for name, path in paths.items() if path is not None}


def _ignore(_: object) -> None:
    """No progress is shown."""


def _never() -> bool:
    return False
