"""Methods of other packages are found by their entry points."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.methods import registry
from gridslam.methods.plugins import WithPlugins, plugin_sources
from gridslam.methods.registry import BUILT_IN, MethodEntry


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


def methods() -> WithPlugins[MethodEntry]:
    return WithPlugins(BUILT_IN, MethodEntry)


ENTRY = (
    "from gridslam.methods.registry import MethodEntry\nENTRY = MethodEntry(config='added_method:Config')\n"
)


def test_the_programs_own_methods_come_first_and_an_installed_one_after_them(packages: Path) -> None:
    install(packages, "added = added_method:ENTRY", code=ENTRY)
    found = methods()
    assert list(found) == [*BUILT_IN, "added"]
    assert "added" in found
    assert found["added"].config == "added_method:Config"
    assert plugin_sources() == [packages / "added_method.py"]


def test_what_is_not_there_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        methods()["added"]


@pytest.mark.parametrize(
    ("entry", "code", "message"),
    [
        ("added = added_method:ENTRY", "import no_such_module\n", "cannot be loaded .*no_such_module"),
        ("added = added_method:NOTHING", ENTRY, "cannot be loaded .*NOTHING"),
        ("added = added_method:ENTRY", "ENTRY = 3\n", "is a int, expected a MethodEntry"),
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
