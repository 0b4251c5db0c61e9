"""The file of a sweep is checked to the last key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core.errors import ConfigError
from gridslam.sweep.config import SweepConfig, load_sweep

MINIMAL: dict[str, Any] = {"command": "map", "logs": [{"log": "a.mcap"}], "configs": ["slam-sd"]}


def load(folder: Path, **changes: Any) -> SweepConfig:
    path = folder / "sweep.yaml"
    path.write_text(yaml.safe_dump({**MINIMAL, **changes}))
    return load_sweep(path)


def test_little_has_to_be_said(tmp_path: Path) -> None:
    sweep = load(tmp_path)
    assert sweep.seeds == (0,)
    assert dict(sweep.overrides) == {"default": ()}
    assert sweep.logs[0].label == "a"


@pytest.mark.parametrize(
    ("given", "seeds"), [("3..5", (3, 4, 5)), (7, (7,)), ([1, 5], (1, 5)), ("0..0", (0,))]
)
def test_seeds_are_a_number_a_list_or_a_range(tmp_path: Path, given: object, seeds: tuple[int, ...]) -> None:
    assert load(tmp_path, seeds=given).seeds == seeds


def test_configs_are_named_by_their_files(tmp_path: Path) -> None:
    assert list(load(tmp_path, configs=["slam-sd", "paper/slam-sd", "my/own.yaml"]).configs) == [
        "slam-sd",
        "paper-slam-sd",
        "own",
    ]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sedes": 1}, "sedes: no such key.*did you mean 'seeds'"),
        ({"seeds": "5..3"}, "expected FIRST..LAST"),
        ({"seeds": "0..999999999"}, "at most"),
        ({"seeds": "0..99999", "overrides": {"a": [], "b": []}}, "are 200000 runs; at most 100000"),
        ({"seeds": "0..10000", "logs": [{"world": "office"}]}, "are 10001 simulations; at most 10000"),
        ({"seeds": [1, 1]}, "seed '1' is given twice"),
        ({"seeds": []}, "seeds"),
        ({"logs": []}, "logs"),
        ({"logs": [{"log": "a", "world": "b"}]}, "either log or world"),
        ({"logs": [{"log": "a"}, {"log": "b/a.mcap"}]}, "log 'a' is given twice"),
        ({"logs": [{"log": "a", "name": "../../etc"}]}, "cannot name a folder"),
        ({"logs": [{"log": "a", "name": ".."}]}, "cannot name a folder"),
        ({"overrides": {"a/b": []}}, "cannot name a folder"),
        ({"configs": {".hidden": "slam-sd"}}, "cannot name a folder"),
        ({"logs": [{"log": "a", "map": "m.yaml"}]}, "only localize takes a map"),
        ({"require": ["ape"]}, "expected KEY<=NUMBER"),
        ({"require": [{"that": "ape<1", "config": "x"}]}, "expected one of slam-sd"),
        ({"successes": {"good": ["mean(ape)<1"]}}, "expected a bound on single runs"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load(tmp_path, **changes)


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@settings(deadline=None)
@given(key=st.sampled_from([*SweepConfig.model_fields]), value=anything)
def test_no_value_of_any_key_is_a_bug(
    tmp_path_factory: pytest.TempPathFactory, key: str, value: object
) -> None:
    folder = tmp_path_factory.getbasetemp()
    try:
        load(folder, **{key: value})
    except ConfigError as error:
        assert "sweep.yaml" in str(error)
