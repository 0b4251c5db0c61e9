"""The words of tests/glossary.py stay out of the code."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import glossary


def test_code_and_pages_are_written_in_the_words_of_the_field() -> None:
    found = [str(finding) for finding in glossary.findings()]
    assert not found, "\n".join(found[:20])


def test_a_word_of_the_table_is_found_in_snake_and_camel_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glossary, "REPOSITORY", tmp_path)
    (tmp_path / "a.py").write_text(
        "least_fit = 1\nclass ThingOfTag: ...\nat_least = 2\nalways = almost = 3\n"
    )
    assert [f.text for f in glossary.identifiers_of(Path("a.py"))] == ["least_fit", "ThingOfTag"]


def test_class_names_occur_once() -> None:
    defined: dict[str, list[str]] = {}
    for root in ("gridslam", "cli"):
        for file in sorted((glossary.REPOSITORY / root).rglob("*.py")):
            for line in file.read_text(encoding="utf-8").splitlines():
                if line.startswith("class "):
                    name = line.removeprefix("class ").split("(")[0].split(":")[0]
                    defined.setdefault(name, []).append(str(file))
    twice = {name: files for name, files in defined.items() if len(files) > 1}
    assert not twice
