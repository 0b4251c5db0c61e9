"""The public surface: every name is there, the import is light, and the examples of docs/python.md run."""

from __future__ import annotations

import dataclasses
import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest

import gridslam
from gridslam.methods import registry
from tests.conftest import REPOSITORY
from tests.dead_reckoning import ENTRY

DOCS = REPOSITORY / "docs"
# What public objects hold and nobody needs by name, with the object that holds it.
INTERNAL = {
    ("Run", "FinishedRun"),  # what the commands report; its form may change
    ("RunConfig[BaseModel]", "load_config"),  # is a RunConfig
    ("DriveLimits", "SpeedLimits"),
    ("Sweep", "LidarExtrinsics"),
    ("Projection", "LidarExtrinsics"),
}


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


def test_numbers_and_arrays_of_numpy_are_settings() -> None:
    settings = {
        "particles": {"min": np.int64(30)},
        "start": np.array([1, 2, 0.5]),
        "scan.max_range_m": np.float32(8.0),
    }
    method = gridslam.load_config("ispace-mcl", settings=settings).method.model_dump()
    assert (method["particles"]["min"], method["start"], method["scan"]["max_range_m"]) == (
        30,
        (1.0, 2.0, 0.5),
        8.0,
    )


def test_a_path_is_a_setting_and_a_value_without_a_form_in_yaml_is_an_error() -> None:
    config = gridslam.load_config({"method": {"name": "slam-sd"}, "log": {"csv": Path("layout.yaml")}})
    assert config.log.csv == Path("layout.yaml")
    with pytest.raises(
        gridslam.ConfigError, match=r"^method\.particles: <object .* is of type object; give numbers"
    ):
        gridslam.load_config("slam-sd", settings={"particles": object()})


def test_a_section_with_the_name_of_an_argument_is_given_by_settings(small_log: Path) -> None:
    settings = {"drawing.walls_are": "dark", "drawing": {"walls_are": "bright"}}
    assert gridslam.load_config("handmap-slam", settings=settings).method.drawing.walls_are == "bright"  # type: ignore[attr-defined]
    with pytest.raises(gridslam.ConfigError, match=r"--drawing FILE: handmap-slam needs it"):
        gridslam.map_log(small_log, "handmap-slam", settings={"drawing": {"walls_are": "dark"}})
    with pytest.raises(
        gridslam.ConfigError, match=r"method\.particles: is given in `settings` and as a keyword"
    ):
        gridslam.map_log(small_log, "slam-sd", settings={"particles": 3}, particles=4)


def test_an_opened_log_is_read_anew_with_the_settings_that_it_was_opened_with(
    small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "METHODS", {**registry.METHODS, "dead-reckoning": ENTRY})
    config = {"method": {"name": "dead-reckoning"}}
    whole = gridslam.map_log(small_log, config)
    with gridslam.open_log(small_log, gridslam.LogConfig(end_s=1.0)) as log:
        part = gridslam.map_log(log, config)
        assert len(list(log.events())) > 0
        with pytest.raises(gridslam.ConfigError, match="was opened with other settings"):
            gridslam.map_log(log, {**config, "log": {"end_s": 2.0}})
        with (
            gridslam.open_log(small_log) as other,
            pytest.raises(gridslam.ConfigError, match="other settings"),
        ):
            gridslam.map_log([log, other], config)
    assert 0 < len(part.trajectory) < len(whole.trajectory)
    assert part.run.config.log.end_s == 1.0


def test_a_map_saved_and_loaded_is_the_same(tmp_path: Path) -> None:
    grid = gridslam.load_map(REPOSITORY / "sample_logs" / "slam-sd.truth" / "map.yaml")
    gridslam.save_map(grid, tmp_path / "copy.yaml")
    again = gridslam.load_map(tmp_path / "copy.yaml")
    assert again.geometry == grid.geometry
    np.testing.assert_array_equal(again.probability, grid.probability)


def test_the_examples_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (DOCS / "python.md").read_text()
    script = "\n".join(re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL))
    (tmp_path / "sample_logs").symlink_to(REPOSITORY / "sample_logs")
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "docs/python.md", "exec"), {"__name__": "__main__"})
    assert (tmp_path / "out" / "notebook" / "map.pgm").exists()


def classes_in(annotation: object) -> set[type]:
    if isinstance(annotation, type) and annotation.__module__.startswith("gridslam"):
        return {annotation}
    return (
        set().union(*(classes_in(part) for part in get_args(annotation))) if get_args(annotation) else set()
    )


def returned_classes(value: object) -> set[type]:
    """The program's own classes that a public function returns, or that the attributes of a public class have."""
    if not inspect.isclass(value):
        return classes_in(get_type_hints(value).get("return")) if inspect.isfunction(value) else set()
    members = [
        m.fget if isinstance(m, property) else m for n, m in vars(value).items() if not n.startswith("_")
    ]
    found = [classes_in(get_type_hints(m).get("return")) for m in members if inspect.isfunction(m)]
    if dataclasses.is_dataclass(value) or issubclass(value, tuple):
        found += [classes_in(hint) for hint in get_type_hints(value).values()]
    return set().union(*found)


def test_what_public_functions_return_and_public_classes_hold_is_public() -> None:
    public = [getattr(gridslam, name) for name in gridslam.PUBLIC]
    modules = {value.__name__ for value in public if inspect.ismodule(value)}
    hidden = {
        (found.__name__, getattr(value, "__name__", value))
        for value in public
        for found in returned_classes(value)
        if found not in public and found.__module__ not in modules
    }
    assert hidden <= INTERNAL


def test_the_page_of_the_api_has_every_public_name() -> None:
    page = (DOCS / "api.md").read_text()
    blocks = dict(re.findall(r"^::: (\S+)\n((?: +.*\n)*)", page, re.MULTILINE))

    def is_documented(name: str, module: str) -> bool:
        members = re.search(r"members: \[(.*)\]", blocks.get(module, ""))
        whole = module in blocks and (members is None or name in members[1].split(", "))
        return whole or f"{module}.{name}" in blocks

    assert [name for name, module in gridslam.PUBLIC.items() if not is_documented(name, module)] == []


def test_the_page_about_methods_imports_only_public_names_and_its_code_loads() -> None:
    page = (DOCS / "adding-a-method.md").read_text()
    (code,) = re.findall(r"dead_reckoning\.py <<'END'\n(.*?)^END$", page, flags=re.MULTILINE | re.DOTALL)
    assert re.findall(r"^\s*(?:import|from) +(gridslam\S*)", page, re.MULTILINE) == ["gridslam"]
    namespace: dict[str, object] = {"__name__": "dead_reckoning"}
    exec(compile(code, "adding-a-method.md", "exec"), namespace)
    (names,) = re.findall(r"^from gridslam import \((.*?)\)", code, flags=re.MULTILINE | re.DOTALL)
    assert {name.split(" as ")[0].strip() for name in names.split(",") if name.strip()} <= set(
        gridslam.PUBLIC
    )
    assert isinstance(namespace["ENTRY"], gridslam.MethodEntry)
