"""The paper's settings of handmap-slam, and a check of two settings together."""

from __future__ import annotations

import pytest

from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.runs.run_config import load_config


def test_the_paper_s_settings_switch_off_what_the_paper_does_not_have() -> None:
    config = load_config("paper/handmap-slam").method
    assert isinstance(config, HandmapSlamConfig)
    assert config.front_end == "lines" and config.correction
    assert not config.localization.separate_scales
    assert not config.pose_graph.enabled
    assert config.advanced.revisit_fraction == 0.0
    assert not config.advanced.exploration.visit_frontiers


def test_an_empty_scale_range_is_refused() -> None:
    with pytest.raises(ValueError, match="scale_range: expected 0 < smallest < largest, got 2, 1"):
        HandmapSlamConfig.model_validate({"localization": {"scale_range": [2.0, 1.0]}})
