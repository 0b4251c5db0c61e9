"""The model of a sweep file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from gridslam.config.base import StrictModel
from gridslam.config.errors import config_error
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError
from gridslam.core.files import real_path
from gridslam.logs.find import find_logs
from gridslam.sweep.gates import SweepGate, parse_sweep_gate

MAX_SEEDS = 100_000
# All jobs are created before the first starts, in about 1 ms for a run and 60 ms for a world that is generated from its seed
MAX_RUNS, MAX_SIMULATIONS = 100_000, 10_000
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+=-]*(\.[A-Za-z0-9_+=-]+)*")

Name = Annotated[str, Field(max_length=80, description="Also the name of a folder.")]


def _checked_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise ValueError(f"{name!r} cannot name a folder: letters, digits and _ + - = . are allowed")
    return name


class LogEntry(StrictModel):
    """A log, or a world that is simulated once per seed; the inputs of its runs; and the ground truth.

    Paths are relative to the sweep file. `{truth}` in a path stands for the folder NAME.truth beside the log. `truth_map`,
    `truth_objects` and `relations` are files, as for the options of `evaluate`; `drawing` and `tags` are inputs of methods.
    """

    name: Name = Field("", description="Name in the tables. Default: the file's name without its suffix.")
    log: str | None = None
    world: str | None = Field(None, description="A world file or a built-in world.")
    world_set: tuple[str, ...] = Field((), description="Overrides of the world, as for --set.")
    map: str | None = Field(None, description="The map for localize. Default for a world: the true map.")
    drawing: str | None = None
    tags: str | None = None
    inputs: dict[str, str] = Field(
        default_factory=dict, description="Files for further inputs of the methods, by name."
    )
    truth: str | None = Field(
        None, description="As evaluate --truth. Default: the folder NAME.truth, if it exists."
    )
    truth_map: str | None = None
    truth_objects: str | None = None
    relations: str | None = None

    @model_validator(mode="after")
    def _one_source(self) -> LogEntry:
        if (self.log is None) == (self.world is None):
            raise ValueError("give either log or world")
        if self.world_set and self.world is None:
            raise ValueError("world_set: this entry has no world")
        _checked_name(self.label)
        return self

    @property
    def files(self) -> dict[str, str]:
        """The files for inputs of the method, by the input's name."""
        given = {"drawing": self.drawing, "tags": self.tags}
        return {name: path for name, path in given.items() if path is not None} | self.inputs

    @property
    def label(self) -> str:
        """The name in tables and folders."""
        path = Path(self.log or self.world or "")
        return self.name or path.name.removesuffix(".mcap").removesuffix(".yaml")


class Evaluation(StrictModel):
    """Options of the evaluation, as for `gridslam evaluate`."""

    former_keys: ClassVar[Mapping[str, str]] = {"reach_m": "completeness_radius_m"}

    align: Literal["none", "se2", "origin"] | None = Field(
        None, description="Default: se2 for map, none for localize."
    )
    sync: Literal["nearest", "interpolate"] = "nearest"
    max_difference_s: float | None = Field(
        None, ge=0.0, description="Largest time difference (s) of paired poses. Default: 0.01 for nearest."
    )
    max_gap_s: float = Field(
        1.0, ge=0.0, description="Largest time (s) between the two poses that are interpolated."
    )
    completeness_radius_m: float | None = Field(None, ge=0.0)
    max_position_m: float = Field(0.5, ge=0.0)
    max_heading_deg: float = Field(10.0, ge=0.0)


class Requirement(StrictModel):
    """A gate (`that`) for the runs of this log, config and override; for any of them where it is None."""

    that: str
    log: str | None = None
    config: str | None = None
    override: str | None = None


class SweepConfig(StrictModel):
    """A sweep: every log with every config, every set of overrides and every seed."""

    command: Literal["map", "localize"]
    logs: tuple[LogEntry, ...] = Field(min_length=1)
    configs: dict[str, str] = Field(min_length=1, description="name: file or built-in config.")
    overrides: dict[str, tuple[str, ...]] = Field(
        {"default": ()}, min_length=1, description="name: items as for --set."
    )
    seeds: tuple[Annotated[int, Field(ge=0, lt=2**63)], ...] = Field((0,), min_length=1)
    evaluate: Evaluation = Evaluation()
    successes: dict[str, tuple[str, ...]] = Field(
        default_factory=dict, description="name: bounds that a successful run meets."
    )
    require: tuple[str | Requirement, ...] = ()
    show: tuple[str, ...] = Field(
        (), description="Measures in the printed table. Default: the most common ones."
    )
    html: bool = Field(False, description="Write report.html into every run directory.")

    @field_validator("configs", mode="before")
    @classmethod
    def _named_configs(cls, value: object) -> object:
        """The configs by name, for a list without names: a config is named after its file, and paper/slam-sd as paper-slam-sd."""
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            return value
        names = [_name_of_config(item) for item in value]
        _refuse_twice("config", names)
        return dict(zip(names, value, strict=True))

    @field_validator("seeds", mode="before")
    @classmethod
    def _seed_range(cls, value: object) -> object:
        """The seeds as a list, from a range such as `0..19` or a single number."""
        match = (
            re.fullmatch(r"\s*(\d{1,18})\s*\.\.\s*(\d{1,18})\s*", value) if isinstance(value, str) else None
        )
        if match is None:
            return [value] if isinstance(value, int) else value
        first, last = int(match[1]), int(match[2])
        if not first <= last < first + MAX_SEEDS:
            raise ValueError(f"{value}: expected FIRST..LAST, at most {MAX_SEEDS} seeds")
        return list(range(first, last + 1))

    @model_validator(mode="after")
    def _consistent(self) -> SweepConfig:
        _refuse_twice("log", [entry.label for entry in self.logs])
        _refuse_twice("seed", [str(seed) for seed in self.seeds])
        for name in (*self.configs, *self.overrides, *self.successes):
            _checked_name(name)
        runs = len(self.logs) * len(self.configs) * len(self.overrides) * len(self.seeds)
        if runs > MAX_RUNS:
            raise ValueError(
                f"logs x configs x overrides x seeds are {runs} runs; at most {MAX_RUNS} are made"
            )
        simulations = sum(entry.world is not None for entry in self.logs) * len(self.seeds)
        if simulations > MAX_SIMULATIONS:
            raise ValueError(
                f"worlds x seeds are {simulations} simulations; at most {MAX_SIMULATIONS} are made"
            )
        for entry in self.logs:
            if self.command == "map" and entry.map is not None:
                raise ValueError(f"logs: {entry.label}: map: only localize takes a map")
        self._check_gates()
        return self

    def _check_gates(self) -> None:
        """Check that the bounds can be parsed and that the runs they are restricted to exist."""
        known = {
            "log": {entry.label for entry in self.logs},
            "config": set(self.configs),
            "override": set(self.overrides),
        }
        try:
            for gate in self.gates():
                for part, names in known.items():
                    wanted = getattr(gate, part)
                    if wanted is not None and wanted not in names:
                        raise ValueError(
                            f"require: {part} {wanted!r}: expected one of {', '.join(sorted(names))}"
                        )
            for bounds in self.successes.values():
                for text in bounds:
                    if parse_sweep_gate(text).statistic:
                        raise ValueError(f"successes: {text}: expected a bound on single runs")
        except ConfigError as error:
            raise ValueError(str(error)) from None

    def gates(self) -> list[SweepGate]:
        """The parsed requirements."""
        return [
            parse_sweep_gate(item)
            if isinstance(item, str)
            else parse_sweep_gate(item.that, item.log, item.config, item.override)
            for item in self.require
        ]


def load_sweep(path: Path) -> SweepConfig:
    """The checked sweep file. Raises ConfigError with the file, the key path and what is wrong there."""
    document = _with_found_logs(read_yaml(path), real_path(path).parent)
    try:
        return SweepConfig.model_validate(document)
    except ValidationError as error:
        raise config_error(error, SweepConfig, str(path)) from None


def _with_found_logs(document: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The document with one entry for each log, where an entry has a pattern or a folder of logs."""
    logs = document.get("logs")
    if not isinstance(logs, list):
        return document
    entries: list[object] = []
    for item in logs:
        entry = {"log": item} if isinstance(item, str) else item
        text = entry.get("log") if isinstance(entry, dict) else None
        if not isinstance(text, str) or "\0" in text:
            entries.append(item)
            continue
        found = find_logs(folder / text)
        name = entry.get("name")
        for log in found:
            label = f"{name}-{log.name.split('.')[0]}" if name and len(found) > 1 else name
            named = {} if label is None else {"name": label}
            entries.append({**entry, **named, "log": text if len(found) == 1 else str(log)})
    return {**document, "logs": entries}


def _name_of_config(text: str) -> str:
    path = Path(text)
    prefix = "paper-" if path.parent.name == "paper" else ""
    return prefix + path.name.removesuffix(".yaml")


def _refuse_twice(what: str, names: Iterable[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"the {what} {twice[0]!r} is given twice; use different names")
