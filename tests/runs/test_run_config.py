from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from gridslam.config.builtin import builtin_names
from gridslam.core.errors import ConfigError
from gridslam.methods import registry
from gridslam.runs.run_config import load_config, run_config_schema
from tests.dead_reckoning import register


@pytest.fixture(autouse=True)
def _with_test_method(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "METHODS", register())


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    file = tmp_path / "run.yaml"
    file.write_text("method: {name: dead-reckoning, particles: 7}\nseed: 3\n")
    return file


def test_defaults_fill_what_the_file_leaves_out(config_file: Path) -> None:
    config = load_config(str(config_file))
    assert config.method_name == "dead-reckoning"
    assert config.method.model_dump() == {
        "name": "dead-reckoning",
        "resolution_m": 0.1,
        "particles": 7,
        "sleep_s": 0.0,
        "announce": False,
        "fail": "no",
        "start": None,
    }
    assert config.seed == 3


def test_the_command_line_wins_over_the_file(config_file: Path) -> None:
    config = load_config(str(config_file), ["method.particles=50"], seed=9)
    assert config.method.model_dump()["particles"] == 50
    assert config.seed == 9


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (["method.partcles=3"], "method.partcles: no such key (did you mean 'particles'?)"),
        (
            ["method.name=dead-reckonin"],
            "method.name: no method 'dead-reckonin' (did you mean 'dead-reckoning'?)",
        ),
        (["method.name=3"], "method.name: this key is missing"),
        (["method=3"], "method: expected a section with keys, got 3"),
        (["method.particles=0"], "method.particles: input should be greater than or equal to 1, got 0"),
        (["method.particles=many"], "method.particles: input should be a valid integer"),
        (["method.resolution_m=.nan"], "method.resolution_m: input should be a finite number"),
        (["lgo.order=stamp"], "lgo: no such key (did you mean 'log'?)"),
        (["log.order=upwards"], "log.order: expected 'recorded' or 'stamp', got 'upwards'"),
        (["log.carmen.range_mx_m=3"], "log.carmen.range_mx_m: no such key (did you mean 'range_max_m'?)"),
        (["log.extrinsics.laser.yw=1"], "log.extrinsics.laser.yw: no such key (did you mean 'yaw'?)"),
        (["log.topics.scn=/scan"], "log.topics.scn"),
        (["seed=-1"], "seed: input should be greater than or equal to 0"),
    ],
)
def test_an_error_names_file_key_path_and_nearest_key(
    config_file: Path, overrides: list[str], says: str
) -> None:
    with pytest.raises(ConfigError) as error:
        load_config(str(config_file), overrides)
    assert str(config_file) in str(error.value)
    assert says in str(error.value)


def test_an_error_in_an_override_is_marked_as_such(config_file: Path) -> None:
    with pytest.raises(ConfigError, match=r"--set method\.particles: input should be"):
        load_config(str(config_file), ["method.particles=0"])
    config_file.write_text("method: {name: dead-reckoning, particles: 0}")
    with pytest.raises(ConfigError) as error:
        load_config(str(config_file), ["method.resolution_m=0.1"])
    assert "--set" not in str(error.value)


def test_a_config_without_a_method_says_what_to_write(tmp_path: Path) -> None:
    file = tmp_path / "empty.yaml"
    file.write_text("")
    with pytest.raises(ConfigError, match=r"method: this section is missing; write method: \{name: "):
        load_config(str(file))


def test_a_misspelt_method_section_is_recognised(tmp_path: Path) -> None:
    file = tmp_path / "typo.yaml"
    file.write_text("metod: {name: dead-reckoning}\nseed: 1\n")
    with pytest.raises(ConfigError, match=r"method: this section is missing \(there is 'metod'\)"):
        load_config(str(file))


def test_a_name_that_is_no_file_gets_the_nearest_built_in_name() -> None:
    with pytest.raises(ConfigError, match=r"did you mean 'slam-sd'"):
        load_config("slamsd")
    with pytest.raises(ConfigError, match=r"did you mean 'slam-sd'"):
        load_config("configs/nowhere/slam-sd.yaml")


def test_a_file_wins_over_a_built_in_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slam-sd").write_text("method: {name: dead-reckoning}")
    monkeypatch.chdir(tmp_path)
    assert load_config("slam-sd").method_name == "dead-reckoning"


@pytest.mark.parametrize("name", builtin_names())
def test_every_built_in_config_is_valid(name: str) -> None:
    assert load_config(name).method_name == name.removeprefix("paper/")


def test_a_resolved_config_reads_back_as_the_same(config_file: Path, tmp_path: Path) -> None:
    config = load_config(str(config_file))
    again = tmp_path / "again.yaml"
    again.write_text(yaml.safe_dump(config.model_dump(mode="json")))
    assert load_config(str(again)) == config


def test_the_schema_knows_every_method_and_refuses_unknown_keys() -> None:
    schema = run_config_schema()
    json.dumps(schema)
    mapping = schema["properties"]["method"]["discriminator"]["mapping"]
    assert set(mapping) == set(registry.METHODS)
    assert schema["additionalProperties"] is False
