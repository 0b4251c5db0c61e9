"""The settings of handmap-slam: few enough to read, each with a description that stands alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from gridslam.methods.handmap_slam.config import HandmapAdvancedConfig, HandmapSlamConfig
from gridslam.runs.run_config import load_run_config

MAX_KEYS = 15


def leaves(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Keys of a model and its sections, with their fields."""
    for name, field in model.model_fields.items():
        section = field.annotation
        if isinstance(section, type) and issubclass(section, BaseModel):
            yield from leaves(section, f"{path}{name}.")
        else:
            yield f"{path}{name}", field


KEYS = {key: field for key, field in leaves(HandmapSlamConfig) if key != "name"}


def test_there_are_at_most_15_keys_and_15_advanced_ones() -> None:
    advanced = [key for key in KEYS if key.startswith("advanced.")]
    assert len(advanced) <= MAX_KEYS
    assert len(KEYS) - len(advanced) <= MAX_KEYS
    assert len(advanced) == len(list(leaves(HandmapAdvancedConfig)))


@pytest.mark.parametrize("key", KEYS)
def test_every_key_has_a_description(key: str) -> None:
    description = KEYS[key].description
    assert description and description.endswith(".") and description[0].isupper()


def test_the_paper_s_settings_switch_off_what_the_paper_does_not_have() -> None:
    config = load_run_config("paper/handmap-slam").method
    assert isinstance(config, HandmapSlamConfig)
    assert config.front_end == "lines" and config.correction
    assert not config.localization.separate_scales
    assert not config.pose_graph.enabled
    assert config.advanced.revisit_fraction == 0.0
    assert not config.advanced.exploration.visit_frontiers


def test_an_empty_scale_range_is_refused() -> None:
    with pytest.raises(ValueError, match="scale_range: expected 0 < smallest < largest, got 2, 1"):
        HandmapSlamConfig.model_validate({"localization": {"scale_range": [2.0, 1.0]}})
