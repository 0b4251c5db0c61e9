"""What a method needs besides the log stands in its registry entry, also for methods of other packages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.methods import registry
from gridslam.methods.registry import InputKind
from gridslam.runs.inputs import read_inputs
from tests.dead_reckoning import ENTRY


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
        ConfigError, match=r"--blueprint: dead-reckoning has no use for it; nor has any other"
    ):
        read_inputs({"blueprint": tmp_path / "missing"}, "dead-reckoning")


def test_an_input_of_another_method_is_refused_with_the_methods_that_take_it(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"--drawing: slam-sd has no use for it; methods that have: handmap"
    ):
        read_inputs({"drawing": tmp_path / "missing"}, "slam-sd")
