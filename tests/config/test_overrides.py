from __future__ import annotations

import pytest

from gridslam.config.overrides import apply_overrides
from gridslam.core.errors import ConfigError


def test_an_override_replaces_one_key_and_leaves_the_document_alone() -> None:
    document = {"method": {"name": "x", "particles": 30}}
    changed = apply_overrides(document, ["method.particles=50"])
    assert changed == {"method": {"name": "x", "particles": 50}}
    assert document["method"]["particles"] == 30


def test_the_last_override_of_a_key_wins() -> None:
    assert apply_overrides({}, ["a=1", "a=2"]) == {"a": 2}


def test_missing_sections_are_made_also_in_place_of_nothing() -> None:
    assert apply_overrides({"log": None}, ["log.topics.scan=/front"]) == {
        "log": {"topics": {"scan": "/front"}}
    }


def test_the_value_may_hold_an_equals_sign_and_any_yaml() -> None:
    assert apply_overrides({}, ["a=b=c", "d={x: [1, 2]}"]) == {"a": "b=c", "d": {"x": [1, 2]}}


def test_an_override_of_a_shared_node_changes_one_place_only() -> None:
    shared = {"x": 1}
    assert apply_overrides({"a": shared, "b": shared}, ["a.x=2"]) == {"a": {"x": 2}, "b": {"x": 1}}


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("method.particles", "expected key.path=value"),
        ("=3", "expected key.path=value"),
        ("method..x=3", "expected key.path=value"),
        ("seed.x=3", "seed is a value (0), not a section"),
        ("long.x=3", "long is a value ([0, 0, 0, 0, 0, 0, ...]), not a section"),
        ("seed=[1", "--set seed=[1"),
    ],
)
def test_a_malformed_override_is_refused_and_named(override: str, says: str) -> None:
    with pytest.raises(ConfigError) as error:
        apply_overrides({"seed": 0, "long": [0] * 1000}, [override])
    assert says in str(error.value)
