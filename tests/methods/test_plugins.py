"""Methods of other packages are found by their entry points."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from gridslam.api import FinishedRun, map_log
from gridslam.core.errors import ConfigError, GridslamError, LogError, MethodError
from gridslam.methods import registry
from gridslam.methods.plugins import PluginRegistry, plugin_sources
from gridslam.methods.registry import BUILT_IN, MethodEntry
from gridslam.report.write import write_run


def install(folder: Path, *entries: str, code: str = "") -> None:
    """What pip leaves of a package with a module `added_method`."""
    (folder / "added_method.py").write_text(code)
    information = folder / "added_method-1.2.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: added-method\nVersion: 1.2\n")
    (information / "entry_points.txt").write_text("\n".join(["[gridslam.methods]", *entries]) + "\n")


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(__import__("sys").modules, "added_method", raising=False)
    return tmp_path


def methods() -> PluginRegistry[MethodEntry]:
    return PluginRegistry(BUILT_IN, MethodEntry, registry.problem_of)


ENTRY = "from gridslam.methods.registry import MethodEntry\nENTRY = MethodEntry(config='added_method:AddedConfig')\n"


def test_the_programs_own_methods_come_first_and_an_installed_one_after_them(packages: Path) -> None:
    install(packages, "added = added_method:ENTRY", code=ENTRY)
    found = methods()
    assert list(found) == [*BUILT_IN, "added"]
    assert "added" in found
    assert found["added"].config == "added_method:AddedConfig"
    assert plugin_sources() == [packages / "added_method.py"]


def test_what_is_not_there_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        methods()["added"]


@pytest.mark.parametrize(
    ("entry", "code", "message"),
    [
        ("added = added_method:ENTRY", "import no_such_module\n", "cannot be loaded .*no_such_module"),
        ("added = added_method:NOTHING", ENTRY, "cannot be loaded .*NOTHING"),
        ("added = added_method:ENTRY", "ENTRY = 3\n", "is of type int, expected MethodEntry"),
        (
            "added = added_method:ENTRY",
            ENTRY.replace("fig')", "fig', needs='scan')"),
            "its needs are not a tuple",
        ),
        (
            "added = added_method:ENTRY",
            ENTRY.replace("fig')", "fig', uses=(5,))"),
            "its uses are not a tuple",
        ),
        (
            "added = added_method:ENTRY",
            ENTRY.replace("fig')", "fig', inputs=None)"),
            "its inputs are not a tuple",
        ),
        (
            "added = added_method:ENTRY",
            ENTRY.replace("fig')", "fig', mapper=5)"),
            "its mapper is not a string",
        ),
    ],
)
def test_a_bad_entry_is_an_error_that_names_the_package(
    packages: Path, entry: str, code: str, message: str
) -> None:
    install(packages, entry, code=code)
    with pytest.raises(ConfigError, match=rf"'added' of the package added-method 1\.2: .*{message}"):
        methods()["added"]


def test_a_name_that_is_taken_is_an_error(packages: Path) -> None:
    install(packages, "slam-sd = added_method:ENTRY", code=ENTRY)
    assert methods()["slam-sd"] is BUILT_IN["slam-sd"]
    with pytest.raises(
        ConfigError, match=r"'slam-sd' of the package added-method 1\.2: there is a method of this name"
    ):
        list(methods())


def test_a_reference_that_leads_nowhere_is_an_error() -> None:
    with pytest.raises(ConfigError, match=r"no_such_module:Thing: .* cannot be loaded"):
        registry.load("no_such_module:Thing")


RAISING = """
import sys
import numpy as np
from typing import Literal
from pydantic import field_validator
from gridslam.config.base import StrictModel
from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods.base import Doubt, Picture, PlacedObject, RunResult, Series, Table
from gridslam.methods.registry import InputKind, MethodEntry

STAGE = {stage!r}

def fail(stage):
    if stage == STAGE:
        raise {error}

class AddedConfig(StrictModel):
    name: Literal["added"] = "added"
    level: int = 0

    @field_validator("level")
    @classmethod
    def _check(cls, value):
        fail("config")
        return value

def read(path):
    fail("reader")

class Mapper:
    estimate = None

    def __init__(self, config, seed, **inputs):
        fail("build")

    def process(self, event):
        fail("process")

    def result(self):
        fail("result")
        pose = [[np.nan if STAGE == "nan" else 1.0, 0.0, 0.0]]
        stamp = -1 if STAGE == "stamp" else 1
        grid = OccupancyGrid(np.full((2, 2), 0.5, np.float32), GridGeometry(0.1, (0.0, 0.0)))
        maps = {{STAGE: grid}} if STAGE in ("../../evil", "/evil", "map", "") else {{}}
        if STAGE == "none":
            return None
        replaced = eval(f"dict({{STAGE}})") if "=" in STAGE else {{}}
        parts = {{"trajectory": Trajectory(np.array([stamp]), np.array(pose)), "occupancy": grid, "maps": maps}}
        return RunResult(**(parts | replaced))

fail("import")
KIND = InputKind("notes", reader="added_method:read")
ENTRY = MethodEntry(config="added_method:AddedConfig", mapper="added_method:Mapper", needs=("scan",), inputs=(KIND,))
"""


def run_added(
    small_log: Path, folder: Path, stage: str, error: str, patch: pytest.MonkeyPatch
) -> FinishedRun:
    install(folder, "added = added_method:ENTRY", code=RAISING.format(stage=stage, error=error))
    patch.setattr(registry, "METHODS", methods())
    notes = folder / "notes.txt"
    notes.touch()
    config = {"method": {"name": "added", "level": 1}, "output": {"viewer": stage == "viewer"}}
    return map_log(small_log, config, inputs={"notes": notes})


@pytest.mark.parametrize("stage", ["import", "config", "reader", "build", "process", "result"])
@pytest.mark.parametrize(
    "error",
    [
        "ZeroDivisionError('of mine')",
        "SystemExit('of mine')",
        "GeneratorExit('of mine')",
        "BaseExceptionGroup('of mine', [GeneratorExit()])",
    ],
)
def test_whatever_a_method_of_a_package_raises_names_the_package(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch, stage: str, error: str
) -> None:
    message = r"^method 'added' of the package added-method 1\.2: .*(Error|Exit|Group): of mine"
    with pytest.raises(GridslamError, match=message):
        run_added(small_log, packages, stage, error, monkeypatch)


@pytest.mark.parametrize(
    ("stage", "message"),
    [
        ("trajectories={'../evil': None}", "trajectories that are not a mapping of names to Trajectory"),
        ("trajectories={'../evil': Trajectory.empty()}", "trajectories of the name '../evil'"),
        ("files={'../evil': b''}", "files of the name '../evil'"),
        ("pictures={'a': 5}", "pictures that are not a mapping"),
        ("tables=[1]", "tables that are not a mapping"),
        ("occupancy=5", "has a map of type int, expected OccupancyGrid"),
        ("occupancy=OccupancyGrid(np.full((2, 2), 5.0), GridGeometry(0.1, (0.0, 0.0)))", "above 1"),
        ("occupancy=OccupancyGrid(np.ones(4), GridGeometry(0.1, (0.0, 0.0)))", "not an array of floats"),
        ("occupancy=OccupancyGrid(np.ones((2, 2)), GridGeometry(np.nan, (0.0, 0.0)))", "finite numbers"),
        ("occupancy=OccupancyGrid(np.ones((2, 2)), GridGeometry('a', (0.0, 0.0)))", "finite numbers"),
        ("occupancy=OccupancyGrid(np.ones((2, 2)), GridGeometry(0.1, (0.0, 1e300)))", "finite numbers"),
        ("occupancy=OccupancyGrid(np.ones((2, 2)), None)", "finite numbers"),
        (
            "occupancy=OccupancyGrid(np.broadcast_to(0.5, (10**6,) * 2), GridGeometry(1.0, (0.0, 0.0)))",
            "the limit",
        ),
        ("trajectory=Trajectory(np.array([1]), np.full((1, 3), 1e300))", "poses beyond"),
        ("trajectory=Trajectory(np.array([1.5]), np.zeros((1, 3)))", "not integers"),
        ("trajectory=Trajectory(np.array([2**70]), np.zeros((1, 3)))", "not integers"),
        ("trajectory=Trajectory(np.array([5, 3]), np.zeros((2, 3)))", "pose 1 is not after the one before"),
        ("trajectory=Trajectory(np.array([5, 5]), np.zeros((2, 3)))", "pose 1 is not after the one before"),
        ("trajectory=Trajectory([5], np.zeros((1, 3)))", "not made of arrays"),
        ("tables={'t': Table(('a', 'b'), [(1, 2), (1,)])}", "row 1 has not one value for each of its 2"),
        ("tables={'t': Table(('a',), [(object(),)])}", "row 0 has a value that is neither a number"),
        ("tables={'t': Table((5,), [])}", "columns are not all texts"),
        ("tables={'t': Table(('a',), None)}", "rows are not a sequence"),
        ("tables={'t': Table(('a',), [5])}", "row 0 has not one value"),
        ("objects=5", "objects that are not a sequence"),
        ("objects=[5]", "objects that are not a sequence"),
        ("objects=[PlacedObject('a', np.zeros(2))]", "object 'a' without a pose"),
        ("objects=[PlacedObject('a', np.full(3, np.nan))]", "object 'a' without a pose"),
        ("objects=[PlacedObject(5, np.zeros(3))]", "name or state is not a string"),
        ("series={'s': Series(np.array([1, 2]), np.zeros(3))}", r"not arrays \(n,\)"),
        ("series={'s': Series(np.array([1]), np.array(['a']))}", "values are not numbers"),
        ("position_std=5", "series that is not a Series"),
        (
            "layers={'l': GridLayer(np.array([[None]]), GridGeometry(0.1, (0.0, 0.0)))}",
            "not an array of numbers",
        ),
        (
            "occupancy=OccupancyGrid(np.ma.masked_array(np.ones((2, 2)), True), GridGeometry(0.1, (0.0, 0.0)))",
            "not a plain array, but a MaskedArray",
        ),
        (
            "occupancy=OccupancyGrid(np.broadcast_to(0.5, (1, 2 * 10**6)), GridGeometry(1.0, (0.0, 0.0)))",
            "the limit of a side",
        ),
        (
            "layers={'l': GridLayer(np.broadcast_to(0.0, (20000, 20000)), GridGeometry(0.1, (0.0, 0.0)))}",
            "layers of more than",
        ),
        (
            "layers={'l\\0': GridLayer(np.ones((1, 1)), GridGeometry(0.1, (0.0, 0.0)))}",
            "printable characters",
        ),
        ("layers={5: GridLayer(np.ones((1, 1)), GridGeometry(0.1, (0.0, 0.0)))}", "layer 5 without a name"),
        ("pictures={'p': Picture(np.zeros((0, 4, 3), np.uint8), 'p')}", "without pixels"),
        ("pictures={'p': Picture(np.zeros((4, 4, 3), np.uint8), 5)}", "title is not a string"),
        ("files={'map.pgm': b''}", r"one for a file of the run"),
        ("files={'a.csv': b''}, tables={'a': Table(('a',), [])}", r"two parts for the file 'a\.csv'"),
        ("counters={5: 3}", "counters that are not a mapping of names"),
        ("counters={'a': 'b'}", "counters that are not numbers"),
        ("timings_s={'a': None}", "timings_s that are not numbers"),
        ("measures=[1]", "measures that are not a mapping"),
        ("notes='all well'", "notes that are not a sequence of strings"),
        ("notes=[5]", "notes that are not a sequence of strings"),
        ("notes=['\\ud800']", "notes that are not a sequence of strings"),
        ("loops_ns=np.zeros(3)", "loops_ns that are not integers"),
        ("untrusted_ns=None", "untrusted_ns that are not integers"),
        ("measures=(lambda m: m.update(m=m) or m)({})", "more than 100000 mappings, lists and values"),
        ("measures={'a': np.zeros(10**6)}", "more than 100000 mappings, lists and values"),
        ("notes=['a'] * 10**6", "1000000 notes; the limit is 10000"),
        ("notes=['a' * 10**7]", "10000000 characters in its notes"),
        ("counters={str(i): i for i in range(20000)}", "20000 counters; the limit"),
        ("objects=[PlacedObject('a', np.zeros(3))] * 10**6", "1000000 objects; the limit"),
        ("loops_ns=np.ones((10**6, 2), np.int64)", "1000000 loops; the limit"),
        ("files={f'f{i}': b'' for i in range(2000)}", "2000 files; the limit is 1000"),
        ("tables={'t': Table(('a', 'b'), range(10**7))}", "20000000 cells in its tables"),
        (
            "layers={f'l{i}': GridLayer(np.ones((1, 1)), GridGeometry(0.1, (0.0, 0.0))) for i in range(2000)}",
            "2000 layers; the limit",
        ),
        ("doubt=5", "a doubt that is not a Doubt"),
        ("doubt=Doubt('bad', 'so')", "a doubt that is not a Doubt"),
        ("maps=type('M', (dict,), {'values': lambda self: 1 / 0})()", "ZeroDivisionError"),
        ("none", "is of type NoneType, expected RunResult"),
        ("nan", "poses that are not finite"),
        ("stamp", "negative stamps"),
        ("../../evil", "maps of the name"),
        ("/evil", "maps of the name"),
        ("map", "maps of the name"),
        ("", "maps of the name"),
    ],
)
def test_a_wrong_result_of_a_package_is_refused(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch, stage: str, message: str
) -> None:
    with pytest.raises(MethodError, match=rf"added-method 1\.2: .*{message}"):
        run_added(small_log, packages, stage, "AssertionError", monkeypatch)


@pytest.mark.parametrize(
    ("stage", "message"),
    [
        ("tables={'t': Table(('a',), [('\\ud800',)])}", "UnicodeEncodeError"),
        ("tables={'t': Table(('a',), [(10**5000,)])}", "ValueError"),
        ("measures=__import__('functools').reduce(lambda m, _: {'m': m}, range(5000), {})", "RecursionError"),
    ],
)
def test_what_cannot_be_written_names_the_package(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch, stage: str, message: str
) -> None:
    done = run_added(small_log, packages, stage, "AssertionError", monkeypatch)
    with pytest.raises(MethodError, match=rf"added-method 1\.2: .*{message}"):
        done.save(packages / "out")
    assert not (packages / "out").exists()


@pytest.mark.parametrize(
    "estimate", ["5", "Estimate(5, np.full(3, 1e300))", "Estimate(5, np.full(3, np.nan))"]
)
def test_an_estimate_that_is_none_names_the_package(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch, estimate: str
) -> None:
    code = RAISING.replace("estimate = None", f"estimate = {estimate}").replace(
        "import Doubt,", "import Doubt, Estimate,"
    )
    monkeypatch.setattr(sys.modules[__name__], "RAISING", code)
    with pytest.raises(MethodError, match=r"added-method 1\.2: TypeError: the estimate has no stamp"):
        run_added(small_log, packages, "viewer", "AssertionError", monkeypatch)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (
            "__import__('pydantic').ValidationError.from_exception_data('of mine', [])",
            "ValidationError: 0 validation errors for of mine",
        ),
        ("__import__('gridslam.core.errors').core.errors.GridslamError('of mine')", "GridslamError: of mine"),
        ("type('Mute', (Exception,), {'__str__': lambda self: 1 / 0})", "Mute: "),
    ],
)
def test_an_error_of_a_kind_that_means_something_elsewhere_names_the_package(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch, error: str, message: str
) -> None:
    with pytest.raises(MethodError, match=rf"added-method 1\.2: {message}"):
        run_added(small_log, packages, "process", error, monkeypatch)


def test_an_error_that_is_raised_on_purpose_is_unchanged(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    error = "__import__('gridslam.core.errors').core.errors.LogError('this log is too dark')"
    with pytest.raises(LogError, match=r"^this log is too dark$"):
        run_added(small_log, packages, "process", error, monkeypatch)


def test_ctrl_c_in_a_method_of_a_package_is_ctrl_c(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(KeyboardInterrupt):
        run_added(small_log, packages, "process", "KeyboardInterrupt", monkeypatch)


def test_a_config_that_is_no_model_names_the_package(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = RAISING.replace("class Mapper:", "AddedConfig = dict\n\nclass Mapper:")
    monkeypatch.setattr(sys.modules[__name__], "RAISING", code)
    with pytest.raises(ConfigError, match=r"added-method 1\.2: its config .* is not a pydantic model"):
        run_added(small_log, packages, "nothing", "AssertionError", monkeypatch)


def test_numbers_of_a_result_that_json_lacks_are_written_and_returned(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = "counters={'a': np.int64(3)}, timings_s={'b': np.nan}"
    document = write_run(
        run_added(small_log, packages, stage, "AssertionError", monkeypatch).run, packages / "out"
    )
    assert json.loads(json.dumps(document, allow_nan=False))["counters"] == {"a": 3}


def test_what_a_method_of_a_package_prints_is_not_on_stdout(
    packages: Path, small_log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = RAISING.replace("def fail(stage):", "print('imported')\n\ndef fail(stage):\n    print(stage)")
    monkeypatch.setattr(sys.modules[__name__], "RAISING", code)
    run_added(small_log, packages, "nothing", "AssertionError", monkeypatch)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert {"imported", "config", "build", "process", "result"} <= set(shown.err.split())
