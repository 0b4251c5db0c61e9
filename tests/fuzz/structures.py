"""What `tests.fuzz.many` feeds by the thousand: each target makes an input from random numbers and names the outcome."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import ValidationError

from gridslam import api
from gridslam.config.builtin import read_config
from gridslam.core.errors import GridslamError
from gridslam.evaluation.inputs import EvaluationOptions
from gridslam.logs.log import Log
from gridslam.logs.open import open_log
from gridslam.maps.load import load_any_map
from gridslam.maps.tag_database import load_tag_database
from gridslam.methods import registry
from gridslam.runs.run_config import run_config_model, validate_run_config
from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import WorldConfig, validate_world
from gridslam.sweep.config import load_sweep
from tests.fuzz import command_lines, definitions, log_records, targets, text_logs
from tests.fuzz.map_files import write_odd_map
from tests.fuzz.value_trees import at_bounds, damaged, drawn

RUN_ONE_IN = 40  # valid configurations
POSES = "".join(f"{i}.5 {i} {i % 3} 0 0 0 0 1\n" for i in range(1, 12))
WORLD: dict[str, Any] = yaml.safe_load("""
walls: [{rectangle: [0, 0, 4, 3]}]
boxes: [{centre: [3, 2], size: [0.4, 0.4]}]
robot: {start: [1, 1, 0], route: [[1.3, 1]]}
sensors: {lidar: {rate_hz: 5, beams: 60}, odometry: {}, gyro: {}}
max_duration_s: 6
""")
SUFFIXES = {"summary": "mcap", "foreign": "mcap"}  # of logs whose target has another name
LIMIT_S, LIMIT_PIXELS = 20.0, 50_000_000  # of the longest simulated drive, of all its pictures


def log_target(kind: str) -> Callable[[random.Random, Path], str]:
    """A target of logs of a kind."""

    def run(rng: random.Random, folder: Path) -> str:
        sample = folder / ("sample" if kind == "csv" else "sample.mcap")
        if not sample.exists():
            log_records.write_sample(sample)
        return log_records.check(
            log_records.MAKERS[kind](folder / f"log.{SUFFIXES.get(kind, kind)}", sample, rng), folder
        )

    return run


def read_table(rng: random.Random, folder: Path) -> str:
    """A table alone, by a layout that may not fit it."""
    try:
        config = text_logs.table_config(rng)
    except ValidationError:
        return "layout"
    place = folder / "table"
    place.mkdir(exist_ok=True)
    return log_records.check(text_logs.fuzz_table(place / "log", folder, rng), folder, config)


def answer(act: Callable[[], object]) -> str:
    """`done`, or the name of the GridslamError, which has one line."""
    try:
        act()
    except GridslamError as error:
        assert str(error).strip()
        assert "\n" not in str(error), "one line"
        return type(error).__name__
    return "done"


@cache
def documents() -> dict[str, tuple[str, Any]]:
    """File name and content of YAML files that are read."""
    world = {**WORLD, "doors": [{"id": "d", "hinge": [1, 0], "closed_at": [2, 0]}]}
    texts = {
        "map.yaml": targets.MAP_YAML,
        "csv/log.yaml": targets.LAYOUT,
        "bag/metadata.yaml": targets.METADATA,
        "sweep.yaml": targets.SWEEP,
        "tags.yaml": targets.TAGS,
        "config.yaml": targets.CONFIG,
    }
    return {name: (name, yaml.safe_load(text)) for name, text in texts.items()} | {
        "world.yaml": ("world.yaml", world)
    }


def read_tree(rng: random.Random, folder: Path) -> str:
    """A YAML file of any kind whose tree is damaged."""
    name, document = documents()[rng.choice(list(documents()))]
    tree = damaged(document, rng)
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    text = yaml.dump(tree, sort_keys=False).replace("\\uD800", "\\x00")
    path.write_text(text, "utf-8")
    (folder / "map.pgm").write_bytes(targets.PGM)
    (folder / "csv").mkdir(exist_ok=True)
    (folder / "csv" / "odom.csv").write_text(targets.ODOM)

    def read() -> None:
        if name == "config.yaml":
            api.load_config(path)
        elif name == "world.yaml":
            validate_world(read_config(str(path))[0], "world.yaml")
        elif name == "map.yaml":
            check_map(path)
        elif name == "sweep.yaml":
            load_sweep(path)
        elif name == "tags.yaml":
            load_tag_database(path)
        else:
            with open_log(path.parent, log_records.CONFIG) as log:
                drain(log)

    return f"{name.split('.')[0].split('/')[0]} {answer(read)}"


def drain(log: Log) -> None:
    """Read all events; the lines for the user are few and printable."""
    for _ in log.events():
        pass
    log.truth()
    assert len(log.problems) < 200
    assert all("\n" not in line for line in log.problems)


def check_map(path: Path) -> None:
    """Load a map; what is loaded is a probability, or NaN for unknown, everywhere."""
    grid = load_any_map(path)
    known = grid.probability[~np.isnan(grid.probability)]
    assert ((known >= 0.0) & (known <= 1.0)).all()
    assert grid.geometry.resolution_m > 0.0


def read_map(rng: random.Random, folder: Path) -> str:
    """An odd map is loaded."""
    path = write_odd_map(folder, rng)
    return answer(lambda: check_map(path))


def read_trajectory(rng: random.Random, folder: Path) -> str:
    """A trajectory of any format with changed cells, evaluated against itself."""
    suffix, separator = rng.choice(((".tum", " "), (".txt", " "), (".csv", ",")))
    lines = [line.split() for line in POSES.splitlines()]
    if rng.random() < 0.2:
        lines = [["1", "0", "0", "1", "0", "1", "0", "0", "0", "0", "1", "0"]] * 5
    for _ in range(rng.randrange(4)):
        row = rng.choice(lines)
        if row and rng.random() < 0.8:
            row[rng.randrange(len(row))] = rng.choice(
                (*log_records.NUMBERS, "1e19", "-5", "0x1", "\u0661", "#")
            )
        else:
            lines[rng.randrange(len(lines))] = rng.choice(([], ["#"], row * 2, row[:-1]))
    path, true = folder / f"path{suffix}", folder / "true.tum"
    path.write_text("\n".join(separator.join(row) for row in lines) + "\n", "utf-8")
    true.write_text(POSES)

    options = EvaluationOptions(align=rng.choice(("none", "se2", "sim2", "first")))

    def read() -> None:
        api.evaluate(path, true, options=options)

    return answer(read)


@cache
def full_config(name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """A method's configuration with all keys, and its schema."""
    model = run_config_model(name)
    document = validate_run_config({"method": {"name": name}}, name).model_dump(
        mode="json", exclude_none=True
    )
    return document, model.model_json_schema()


def read_config_values(rng: random.Random, folder: Path) -> str:
    """A configuration with drawn values; some of the valid ones map a small log."""
    name = rng.choice(list(registry.BUILT_IN))
    document, schema = full_config(name)
    document = drawn(document, schema, rng, rng.choice((1, 1, 2, 4)))
    document["method"] = (
        {**document["method"], "name": name} if isinstance(document.get("method"), dict) else {}
    )
    valid: list[object] = []
    result = answer(lambda: valid.append(validate_run_config(document, "drawn.yaml")))
    if not valid or name not in ("slam-sd", "handmap-slam") or rng.randrange(RUN_ONE_IN):
        return f"{name} {result}"
    log = command_lines.small_log(folder)
    return f"{name} run {answer(lambda: api.map_log(log, valid[0]))}"  # type: ignore[arg-type]


def read_extremes(rng: random.Random, folder: Path) -> str:
    """A world or a configuration with several allowed values at their bounds; every valid one is worked with."""
    if rng.random() < 0.5:
        return f"world {_world_answer(at_bounds(WORLD, world_schema(), rng), folder)}"
    name = rng.choice(("slam-sd", "handmap-slam"))
    document, schema = full_config(name)
    document = at_bounds(document, schema, rng)
    document["method"]["name"] = name
    valid: list[object] = []
    result = answer(lambda: valid.append(validate_run_config(document, "drawn.yaml")))
    if not valid:
        return f"{name} check {result}"
    log = command_lines.small_log(folder)
    return f"{name} run {answer(lambda: api.map_log(log, valid[0]))}"  # type: ignore[arg-type]


@cache
def world_schema() -> dict[str, Any]:
    return WorldConfig.model_json_schema()


def pixels(world: WorldConfig) -> float:
    """Pixels of all pictures that a world asks for, which is honest work."""
    cameras = [*world.sensors.cameras, *world.fixed_cameras]
    return world.max_duration_s * sum(c.width_px * c.height_px * c.rate_hz for c in cameras)


def read_world(rng: random.Random, folder: Path) -> str:
    """A world with drawn values; valid ones are recorded, and the log is one that its own reader takes whole."""
    return _world_answer(drawn(WORLD, world_schema(), rng, rng.choice((1, 1, 2, 4))), folder)


def _world_answer(document: dict[str, Any], folder: Path) -> str:
    valid: list[WorldConfig] = []
    result = answer(lambda: valid.append(validate_world(document, "drawn.yaml")))
    if (
        not valid
        or valid[0].max_duration_s > LIMIT_S
        or valid[0].robot.laps > 3
        or pixels(valid[0]) > LIMIT_PIXELS
    ):
        return f"check {result}"
    output = folder / "world.mcap"

    def record() -> None:
        record_world(valid[0], folder, output, force=True)
        with open_log(output) as log:
            drain(log)
            assert not log.is_lossy, log.problems

    return f"record {answer(record)}"


STRUCTURES: Mapping[str, Callable[[random.Random, Path], str]] = {
    **{kind: log_target(kind) for kind in log_records.MAKERS},
    "table": read_table,
    "definition": definitions.fuzz_definition,
    "yaml": read_tree,
    "map": read_map,
    "trajectory": read_trajectory,
    "config": read_config_values,
    "world": read_world,
    "extremes": read_extremes,
    **command_lines.TARGETS,
}
