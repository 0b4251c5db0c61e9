"""The settings of slam-sd: few, and each with a description that stands alone."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

from pydantic import BaseModel

from gridslam.methods.slam_sd.config import SlamSdConfig

MAX_KEYS = 15


def leaf_keys(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str | None]]:
    """Paths of all leaf keys of a model, with their descriptions."""
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from leaf_keys(kind, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", field.description


def test_there_are_at_most_fifteen_keys_and_fifteen_advanced_ones() -> None:
    keys = [key for key, _ in leaf_keys(SlamSdConfig)]
    advanced = [key for key in keys if key.startswith("advanced.")]
    assert len(advanced) <= MAX_KEYS
    assert len(keys) - len(advanced) <= MAX_KEYS


def test_every_key_is_described_in_a_sentence() -> None:
    for key, description in leaf_keys(SlamSdConfig):
        if key != "name":
            assert description is not None, key
            assert description[0] == description[0].upper() or description.startswith("joint:"), key
            assert description.endswith("."), key


def test_the_config_is_loaded_without_numba_so_that_jobs_can_still_limit_its_threads() -> None:
    code = "import sys, gridslam.methods.slam_sd.config; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
