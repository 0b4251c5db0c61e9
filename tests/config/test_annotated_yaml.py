from __future__ import annotations

from typing import Annotated, Literal

import pytest
import yaml
from pydantic import Field

from gridslam.config.annotated_yaml import annotated_yaml
from gridslam.config.base import StrictModel
from gridslam.config.builtin import builtin_names
from gridslam.runs.run_config import load_config, validate_run_config


class Advanced(StrictModel):
    """Rarely changed."""

    gain: float = Field(0.5, description="Gain of the filter. Higher values follow the data faster.")


class Filter(StrictModel):
    """A filter."""

    advanced: Advanced = Advanced()
    window: int | None = Field(None, description="Samples in the window. Absent: derived from the rate.")
    weights: list[float] = Field([0.5, 0.5], description="One weight a channel.")


class SampleConfig(StrictModel):
    filter: Filter = Filter()
    name: str = Field("a: b", description="A name.")


def test_the_short_form_leaves_out_advanced_keys_and_says_so() -> None:
    text = annotated_yaml(SampleConfig())
    assert yaml.safe_load(text) == {"filter": {"weights": [0.5, 0.5]}, "name": "a: b"}
    assert text.endswith("# filter.advanced: not shown; add --all\n")


def test_the_long_form_holds_every_key_with_its_description() -> None:
    text = annotated_yaml(SampleConfig(), with_advanced=True)
    assert yaml.safe_load(text)["filter"]["advanced"] == {"gain": 0.5}
    assert "# Gain of the filter. Higher values follow the data faster.\n" in text


def test_a_key_without_a_value_is_a_comment() -> None:
    lines = annotated_yaml(SampleConfig()).splitlines()
    assert (
        "  # window:                           # Samples in the window. Absent: derived from the rate."
        in lines
    )


@pytest.mark.parametrize("name", builtin_names())
def test_what_is_printed_reads_back_as_the_same_configuration(name: str) -> None:
    config = load_config(name)
    document = yaml.safe_load(annotated_yaml(config, with_advanced=True))
    assert validate_run_config(document, name) == config


class SampleSensor(StrictModel):
    """A sensor."""

    range_m: float = Field(description="Longest range.", gt=0.0, le=30.0)


class SampleRobot(StrictModel):
    sensors: dict[str, SampleSensor] = Field(default_factory=dict, description="By name.")
    std: tuple[Annotated[float, Field(ge=0.0)], Annotated[float, Field(ge=0.0)]] = Field(
        (0.1, 0.2), description="Noise."
    )
    mode: Literal["fast", "exact"] = Field("fast", description="Mode.")
    size: int | None = Field(None, ge=16, le=512, multiple_of=16, description="Size. Absent: any.")


def test_ranges_are_those_that_are_checked_and_the_default_is_named_where_another_value_is_shown() -> None:
    lines = [
        " ".join(line.split()) for line in annotated_yaml(SampleRobot(mode="exact", size=32)).splitlines()
    ]
    assert "std: [0.1, 0.2] # Noise. [each >= 0]" in lines
    assert "mode: exact # Mode. [fast or exact; default: fast]" in lines
    assert "size: 32 # Size. Absent: any. [16 to 512, multiple of 16; default: absent]" in lines


def test_a_default_that_a_section_has_in_its_method_is_not_the_class_s() -> None:
    class SampleMethod(StrictModel):
        sensor: SampleSensor = SampleSensor(range_m=5.0)

    assert "[> 0, <= 30]" in annotated_yaml(SampleMethod())
    assert "[> 0, <= 30; default: 5.0]" in annotated_yaml(SampleMethod(sensor=SampleSensor(range_m=7.0)))


def test_the_long_form_says_what_entries_of_a_mapping_consist_of() -> None:
    entry = "#   range_m: Longest range. [> 0, <= 30]"
    assert entry in annotated_yaml(SampleRobot(), with_advanced=True).splitlines()
    assert entry not in annotated_yaml(SampleRobot())
