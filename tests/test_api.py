"""The public surface: every name is there, the import is light, and the examples of docs/python.md run."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gridslam
from tests.conftest import REPOSITORY


@pytest.mark.parametrize("name", gridslam.PUBLIC)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(gridslam, name) is not None
    assert name in dir(gridslam)


def test_public_names_are_the_ones_that_the_type_checker_sees() -> None:
    source = (REPOSITORY / "gridslam" / "__init__.py").read_text()
    assert set(re.findall(r"import \w+ as (\w+)", source)) == set(gridslam.PUBLIC)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"gridslam\.PUBLIC"):
        gridslam.nothing  # noqa: B018


def test_the_import_loads_no_library() -> None:
    script = (
        "import sys, gridslam; print([m for m in ('numpy', 'numba', 'cv2', 'pydantic') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=REPOSITORY)
    assert done.stdout == "[]\n", done.stderr


def test_settings_are_checked_as_in_a_file() -> None:
    with pytest.raises(
        gridslam.ConfigError, match=r"method\.particle: no such key \(did you mean 'particles'\?\)"
    ):
        gridslam.load_config("slam-sd", settings={"particle": 3})
    assert gridslam.load_config({"method": {"name": "slam-sd"}}, seed=5).seed == 5
    loaded = gridslam.load_config("slam-sd", settings={"particles": 3})
    assert gridslam.load_config(loaded) == loaded


def test_a_map_saved_and_loaded_is_the_same(tmp_path: Path) -> None:
    grid = gridslam.load_map(REPOSITORY / "sample_logs" / "slam-sd.truth" / "map.yaml")
    gridslam.save_map(grid, tmp_path / "copy.yaml")
    again = gridslam.load_map(tmp_path / "copy.yaml")
    assert again.geometry == grid.geometry
    np.testing.assert_array_equal(again.probability, grid.probability)


def test_the_examples_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (REPOSITORY / "docs" / "python.md").read_text()
    script = "\n".join(re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL))
    (tmp_path / "sample_logs").symlink_to(REPOSITORY / "sample_logs")
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "docs/python.md", "exec"), {"__name__": "__main__"})
    assert (tmp_path / "out" / "notebook" / "map.pgm").exists()
