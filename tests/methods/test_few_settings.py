"""A method has at most 15 settings, and at most 15 more under `advanced`; each has a description."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.stereo_bayes.config import StereoBayesConfig

MAX_SETTINGS = 15


def leaves(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Path and field of all settings of a config but the method's name."""
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from leaves(field.annotation, f"{path}{name}.")
        elif path or name != "name":
            yield f"{path}{name}", field


@pytest.mark.parametrize("config", [IrScanConfig, StereoBayesConfig])
def test_settings_are_few_and_described(config: type[BaseModel]) -> None:
    settings = dict(leaves(config))
    advanced = [path for path in settings if path.startswith("advanced.")]
    assert len(advanced) <= MAX_SETTINGS
    assert len(settings) - len(advanced) <= MAX_SETTINGS
    assert [path for path, field in settings.items() if not field.description] == []
