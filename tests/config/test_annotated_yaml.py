from __future__ import annotations

import pytest
import yaml
from pydantic import Field

from gridslam.config.annotated_yaml import annotated_yaml
from gridslam.config.base import StrictModel
from gridslam.config.builtin import builtin_names
from gridslam.runs.run_config import load_run_config, validate_run_config


class Advanced(StrictModel):
    """Rarely changed."""

    gain: float = Field(0.5, description="Gain of the filter, 0 to 1. Higher values follow the data faster.")


class Filter(StrictModel):
    """A filter."""

    advanced: Advanced = Advanced()
    window: int | None = Field(None, description="Samples in the window. Absent: derived from the rate.")
    weights: list[float] = Field([0.5, 0.5], description="One weight a channel.")


class Config(StrictModel):
    filter: Filter = Filter()
    name: str = Field("a: b", description="A name.")


def test_the_short_form_leaves_out_advanced_keys_and_says_so() -> None:
    text = annotated_yaml(Config())
    assert yaml.safe_load(text) == {"filter": {"weights": [0.5, 0.5]}, "name": "a: b"}
    assert text.endswith("# filter.advanced: not shown; add --all\n")


def test_the_long_form_holds_every_key_with_its_description() -> None:
    text = annotated_yaml(Config(), with_advanced=True)
    assert yaml.safe_load(text)["filter"]["advanced"] == {"gain": 0.5}
    assert "# Gain of the filter, 0 to 1. Higher values follow the data faster.\n" in text


def test_a_key_without_a_value_is_a_comment() -> None:
    lines = annotated_yaml(Config()).splitlines()
    assert (
        "  # window:                           # Samples in the window. Absent: derived from the rate."
        in lines
    )


@pytest.mark.parametrize("name", builtin_names())
def test_what_is_printed_reads_back_as_the_same_configuration(name: str) -> None:
    config = load_run_config(name)
    document = yaml.safe_load(annotated_yaml(config, with_advanced=True))
    assert validate_run_config(document, name) == config
