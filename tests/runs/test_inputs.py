"""What a method needs besides the log stands in its registry entry, also for methods of other packages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gridslam.api import map_log
from gridslam.core.errors import ConfigError
from gridslam.methods import registry
from gridslam.methods.registry import InputKind
from gridslam.report.run_yaml import command_again
from gridslam.runs.inputs import read_inputs
from gridslam.sweep.config import SweepConfig
from gridslam.sweep.jobs import settings_of_sweep
from tests.dead_reckoning import ENTRY, DeadReckoning, DeadReckoningConfig


def read_plan(path: Path) -> str:
    return path.read_text()


@pytest.fixture
def method_with_input(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = InputKind("floor_plan", reader=f"{__name__}:read_plan", is_needed=True)
    entry = replace(ENTRY, inputs=(kind,))
    monkeypatch.setattr(registry, "load", lambda reference: globals()[reference.partition(":")[2]])
    monkeypatch.setattr(registry, "METHODS", {**registry.METHODS, "dead-reckoning": entry})


@pytest.mark.usefixtures("method_with_input")
def test_a_plug_in_method_gets_the_content_of_an_input_of_its_own_kind(tmp_path: Path) -> None:
    file = tmp_path / "plan.txt"
    file.write_text("walls")
    inputs = read_inputs({"floor_plan": file}, "dead-reckoning")
    assert inputs["floor_plan"].value == "walls"
    assert inputs["floor_plan"].path == file


@pytest.mark.usefixtures("method_with_input")
def test_an_input_that_no_method_takes_is_refused_before_its_file_is_read(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"--input blueprint=FILE: dead-reckoning has no use for it; nor has any other"
    ):
        read_inputs({"blueprint": tmp_path / "missing"}, "dead-reckoning")


def test_an_input_of_another_method_is_refused_with_the_methods_that_take_it(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"--drawing FILE: slam-sd has no use for it; methods that have: handmap"
    ):
        read_inputs({"drawing": tmp_path / "missing"}, "slam-sd")


CONFIG = {"method": {"name": "dead-reckoning"}}


@pytest.mark.usefixtures("method_with_input")
def test_an_input_of_a_plug_in_is_named_as_the_command_line_gives_it(small_log: Path, tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"^--input floor_plan=FILE: dead-reckoning needs it: add it to the command$"
    ):
        map_log(small_log, CONFIG)
    with pytest.raises(ConfigError, match=r"^--input floor_plan=\S*missing: cannot be read"):
        map_log(small_log, CONFIG, inputs={"floor_plan": tmp_path / "missing"})


def test_the_command_of_a_run_gives_inputs_of_a_plug_in_again(
    small_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = InputKind("floor_plan", reader=f"{__name__}:read_plan")

    class WithPlan(DeadReckoning):
        def __init__(self, config: DeadReckoningConfig, seed: int, floor_plan: str) -> None:
            super().__init__(config, seed)
            assert floor_plan == "walls"

    entry = replace(ENTRY, inputs=(kind,), mapper="WithPlan")
    known = {"WithPlan": WithPlan, f"{__name__}:read_plan": read_plan}
    load = registry.load
    monkeypatch.setattr(registry, "load", lambda reference: known.get(reference) or load(reference))
    monkeypatch.setattr(registry, "METHODS", {**registry.METHODS, "dead-reckoning": entry})
    file = tmp_path / "plan.txt"
    file.write_text("walls")
    run = map_log(small_log, CONFIG, inputs={"floor_plan": file}).run
    assert "--input floor_plan=plan.txt" in command_again(run)


def test_a_sweep_says_which_log_lacks_an_input(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    kind = InputKind("floor_plan", reader=f"{__name__}:read_plan", is_needed=True)
    monkeypatch.setattr(
        registry, "METHODS", {**registry.METHODS, "dead-reckoning": replace(ENTRY, inputs=(kind,))}
    )
    (tmp_path / "dead.yaml").write_text("method: {name: dead-reckoning}\n")
    sweep = {"command": "map", "logs": [{"log": "drive.mcap"}], "configs": {"dead": "dead.yaml"}}
    with pytest.raises(ConfigError, match=r"^logs: drive: inputs\.floor_plan: this key is missing"):
        settings_of_sweep(SweepConfig.model_validate(sweep), tmp_path)
    sweep["logs"] = [{"log": "drive.mcap", "inputs": {"floor_plan": "plan.txt"}}]
    assert settings_of_sweep(SweepConfig.model_validate(sweep), tmp_path)
