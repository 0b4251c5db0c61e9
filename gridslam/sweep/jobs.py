"""The jobs of a sweep, each with a hash of everything that it depends on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from gridslam.config.builtin import builtin_names
from gridslam.core.errors import ConfigError
from gridslam.core.files import real_path
from gridslam.methods import registry
from gridslam.report.run_yaml import settings_of
from gridslam.runs.run_config import load_config
from gridslam.simulation.world_config import builtin_worlds, load_worlds
from gridslam.sweep.config import LogEntry, SweepConfig
from gridslam.sweep.contents import Hashes, content_key, program_key


@dataclass(frozen=True, slots=True)
class SimulateJob:
    """Simulation of a world with a seed, which writes log.mcap and log.truth/ into `directory`.

    `key` is the hash of everything that it depends on, `program` that of the program.
    """

    label: str
    key: str
    program: str
    world: dict[str, Any]
    world_folder: Path
    directory: Path


@dataclass(frozen=True, slots=True)
class TruthFiles:
    """Files of ground truth, as in the options of `evaluate`."""

    truth: Path | None = None
    truth_map: Path | None = None
    relations: Path | None = None
    objects: Path | None = None

    @property
    def is_there(self) -> bool:
        """Whether there is any ground truth."""
        return any((self.truth, self.truth_map, self.relations, self.objects))


@dataclass(frozen=True, slots=True)
class RunJob:
    """A run and its evaluation.

    `key` is the hash of everything that the run depends on; `evaluation_key` includes the evaluation; `program` is the hash of
    the program alone.
    """

    log: str
    config: str
    override: str
    seed: int
    command: str
    key: str
    evaluation_key: str
    program: str
    log_path: Path
    settings: dict[str, Any]
    directory: Path
    map_path: Path | None = None
    inputs: dict[str, Path] = field(default_factory=dict)
    truth: TruthFiles = TruthFiles()
    options: dict[str, Any] = field(default_factory=dict)
    is_made: bool = False  # the run directory is complete: only evaluate

    @property
    def label(self) -> str:
        """The run's name in messages."""
        return f"{self.log} {self.config} {self.override} seed {self.seed}"


@dataclass(frozen=True, slots=True)
class RunSettings:
    """A config with one set of overrides and one seed; `document` has its resolved settings."""

    config: str
    override: str
    seed: int
    document: dict[str, Any]
    needs_map: bool = False  # its method localizes only on a map


def settings_of_sweep(sweep: SweepConfig, folder: Path) -> list[RunSettings]:
    """All combinations of config, override and seed. Raises ConfigError if one is invalid or lacks an input."""
    html = f"output.html={'true' if sweep.html else 'false'}"
    found = []
    for (config, source), (override, items) in product(sweep.configs.items(), sweep.overrides.items()):
        name = (
            source if source in builtin_names() and not (folder / source).exists() else str(folder / source)
        )
        run_config = load_config(name, (html, *items), sweep.seeds[0])
        needs_map = _check_method(sweep, run_config.method_name)
        document = settings_of(run_config)
        found += [RunSettings(config, override, s, {**document, "seed": s}, needs_map) for s in sweep.seeds]
    return found


def _check_method(sweep: SweepConfig, name: str) -> bool:
    """Whether the method needs a map. Raises ConfigError if it does not support the command, or a log lacks one of its inputs."""
    entry = registry.METHODS[name]
    if not (entry.mapper if sweep.command == "map" else entry.localizer):
        raise ConfigError(f"command: {name} has no `gridslam {sweep.command}`")
    needs_map = sweep.command == "localize" and not entry.localizes_without_map
    for log in sweep.logs:
        if needs_map and log.map is None and log.world is None:
            raise ConfigError(f"logs: {log.label}: map: this key is missing; {name} localizes on a map")
        for kind in entry.inputs:
            if kind.is_needed and kind.name not in log.files:
                raise ConfigError(
                    f"logs: {log.label}: inputs.{kind.name}: this key is missing; {name} needs it"
                )
    return needs_map


def simulation_jobs(sweep: SweepConfig, folder: Path, output: Path, hashes: Hashes) -> Iterator[SimulateJob]:
    """The simulation jobs. Raises ConfigError if a world is invalid."""
    for entry in sweep.logs:
        if entry.world is None:
            continue
        builtin = entry.world in builtin_worlds() and not (folder / entry.world).exists()
        name = entry.world if builtin else str(folder / entry.world)
        for world, path in load_worlds(name, entry.world_set, sweep.seeds):
            document = world.model_dump(mode="json")
            plan = hashes.of(path.parent / world.plan.file) if world.plan else ""
            yield SimulateJob(
                label=f"{entry.label} seed {world.seed}",
                key=content_key(program=program_key(), world=document, plan=plan),
                program=program_key(),
                world=document,
                world_folder=real_path(path.parent),
                directory=simulation_folder(output, entry.label, world.seed),
            )


def simulation_folder(output: Path, name: str, seed: int) -> Path:
    """Folder of the simulated log of a world and a seed."""
    return output / "logs" / name / f"seed-{seed}"


def job_of_run(
    sweep: SweepConfig, folder: Path, output: Path, entry: LogEntry, settings: RunSettings, hashes: Hashes
) -> RunJob:
    """The job of one run of a sweep: a log of the sweep with the settings of a run.

    folder: Folder of the sweep file; its paths are relative to it.
    output: Directory of the sweep, with simulated logs and results.
    entry: The log.
    settings: Config, overrides and seed.
    hashes: The hashes of files read so far.

    Raises ConfigError or MapError if one of the job's files cannot be read.
    """
    if entry.world is None:
        log = folder / (entry.log or "")
        truth_folder = log.with_name(f"{log.name.removesuffix('.mcap')}.truth")
    else:
        log = simulation_folder(output, entry.label, settings.seed) / "log.mcap"
        truth_folder = log.with_name("log.truth")
    places = _Places(folder, truth_folder)
    map_text = entry.map or ("{truth}/map.yaml" if entry.world and settings.needs_map else None)
    map_path = places.path(map_text)
    inputs = {name: path for name, text in entry.files.items() if (path := places.path(text)) is not None}
    truth = places.truth(entry)
    options = sweep.evaluate.model_dump()
    key = content_key(
        program=program_key(),
        command=sweep.command,
        log=hashes.of(log),
        settings=settings.document,
        map=hashes.of_map(map_path) if map_path else "",
        inputs={name: hashes.of(path) for name, path in inputs.items()},
    )
    evaluation_key = content_key(run=key, options=options, truth=_hashes_of_truth(truth, hashes))
    where = Path(entry.label) / settings.config / settings.override / f"seed-{settings.seed}"
    return RunJob(
        log=entry.label,
        config=settings.config,
        override=settings.override,
        seed=settings.seed,
        command=sweep.command,
        key=key,
        evaluation_key=evaluation_key,
        program=program_key(),
        log_path=log,
        settings=settings.document,
        directory=output / "runs" / where,
        map_path=map_path,
        inputs=inputs,
        truth=truth,
        options=options,
    )


@dataclass(frozen=True, slots=True)
class _Places:
    """Resolves the paths of an entry: they are relative to the sweep file, and `{truth}` is the folder beside the log."""

    folder: Path
    truth_folder: Path

    def path(self, text: str | None) -> Path | None:
        if text is None:
            return None
        if text == "{truth}" or text.startswith("{truth}/"):
            return self.truth_folder / text.removeprefix("{truth}").lstrip("/")
        return self.folder / text

    def truth(self, entry: LogEntry) -> TruthFiles:
        beside = self.truth_folder if self.truth_folder.is_dir() else None
        found = TruthFiles(
            truth=self.path(entry.truth) or beside,
            truth_map=self.path(entry.truth_map),
            relations=self.path(entry.relations),
            objects=self.path(entry.truth_objects),
        )
        for path in (found.truth, found.truth_map, found.relations, found.objects):
            if path is not None and not path.exists():
                raise ConfigError(f"{path}: no such file or folder (the truth of {entry.label})")
        return found


def _hashes_of_truth(truth: TruthFiles, hashes: Hashes) -> list[str]:
    map_hash = hashes.of_map(truth.truth_map) if truth.truth_map else ""
    paths = (truth.truth, truth.relations, truth.objects)
    return [map_hash, *(hashes.of(path) if path else "" for path in paths)]
