"""Whatever a file holds: a valid configuration, or a ConfigError that names it; never a bug."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gridslam.config.overrides import apply_overrides
from gridslam.config.yaml_file import parse_mapping
from gridslam.core.errors import ConfigError
from gridslam.methods import registry
from gridslam.runs.run_config import method_name, run_config_model, validate_run_config

scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12)
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(scalars, inner, max_size=3),
    max_leaves=8,
)


def key_paths(method: str) -> Iterator[str]:
    """All keys of a method's configuration."""

    def below(document: Any, prefix: str) -> Iterator[str]:
        for key, value in document.items():
            yield f"{prefix}{key}"
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")

    yield from below(run_config_model(method).model_validate({"method": {"name": method}}).model_dump(), "")


def validate(document: dict[str, Any]) -> bool:
    """Whether it is valid; a valid one is complete (all that it stands for, written out, means the same)."""
    try:
        config = validate_run_config(document, "any.yaml")
    except ConfigError as error:
        assert "any.yaml" in str(error)
        return False
    assert repr(validate_run_config(config.model_dump(), "again.yaml")) == repr(config)
    return True


@settings(deadline=None)
@given(text=st.text(max_size=200))
@example("{a: &x [*x]}")
@example("? [a, {b: c}]\n: d")
@example("!!python/object/apply:os.system [id]")
@example("a: " + "[" * 300)
@example("\x00")
@example("method: {name: slam-sd, particles: 0x7fffffffffffffffffffffff}")
@example("- 1\n- 2")
@example("method: {name: [slam-sd]}")
def test_any_text(text: str) -> None:
    try:
        validate(parse_mapping(text, "any.yaml"))
    except ConfigError as error:
        assert "any.yaml" in str(error)


@settings(deadline=None)
@given(
    document=st.dictionaries(
        st.sampled_from(["method", "log", "output", "seed", "x"]) | scalars, anything, max_size=4
    )
)
def test_any_document(document: dict[Any, Any]) -> None:
    assert not validate(document) or "method" in document  # without a method nothing can run


@pytest.mark.parametrize("method", registry.METHODS)
def test_any_value_of_any_key(method: str) -> None:
    paths = list(key_paths(method))

    @settings(deadline=None)
    @given(path=st.sampled_from(paths), value=anything)
    def check(path: str, value: object) -> None:
        document: dict[str, Any] = {"method": {"name": method}}
        try:
            text = yaml.safe_dump(value, default_flow_style=True).replace("\n...", "")
            changed = apply_overrides(document, [f"{path}={text}"])
            method_name(changed, "any.yaml")
        except ConfigError as error:
            assert str(error).strip()
            return
        valid.append(validate(changed))

    valid: list[bool] = []
    check()
    assert False in valid  # most values are wrong for most keys
