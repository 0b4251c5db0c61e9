"""The words of tests/glossary.py stay out of the code."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import glossary


def test_code_and_pages_are_written_in_the_words_of_the_field() -> None:
    found = [str(finding) for finding in glossary.findings()]
    assert not found, "\n".join(found[:20])


@pytest.mark.parametrize(
    ("code", "names"),
    [
        (
            "least_fit = 1\nclass ThingOfTag: ...\nat_least = 2\nalways = almost = 3\n",
            ["least_fit", "ThingOfTag"],
        ),
        ("turn = 1\nturn_on_spot = turns_in_place = TurnInPlace = 2\n", ["turn"]),
        ("def test_cells_stay_free_on_the_spot(): ...\n", ["test_cells_stay_free_on_the_spot"]),
        ("x = {'told_m': 1, 'told in a sentence': 2}  # least\n", ["told_m"]),
        ('"""The least of all."""\nx = """\nleast = 1\n"""\n', []),
    ],
)
def test_a_word_of_the_table_is_found_in_names_and_in_texts_like_names(
    code: str, names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glossary, "REPOSITORY", tmp_path)
    (tmp_path / "a.py").write_text(code)
    assert [f.text for f in glossary.names_of(Path("a.py"))] == names


def test_a_name_is_allowed_in_its_files_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glossary, "REPOSITORY", tmp_path)
    for file in ("gridslam/report/a.py", "gridslam/maps/a.py"):
        (tmp_path / file).parent.mkdir(parents=True)
        (tmp_path / file).write_text("draw(outline=1)\n")
    found = [f for root in ("report", "maps") for f in glossary.names_of(Path(f"gridslam/{root}/a.py"))]
    assert [str(f.file) for f in found] == ["gridslam/maps/a.py"]


def test_keys_of_yaml_files_are_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glossary, "REPOSITORY", tmp_path)
    (tmp_path / "a.yaml").write_text("least_m: 1  # told: no key\nlidar: {reach_m: 2}\n")
    assert [f.text for f in glossary.keys_of(Path("a.yaml"))] == ["least_m", "reach_m"]


@pytest.mark.parametrize(
    ("line", "phrases"),
    [
        ("It is told so many times.", ["told", "so many"]),
        ("A easy start, an hour, an MCAP file, a user, an contour.", ["A easy", "an contour"]),
        ("for a in items: at = stream.tell()", []),
    ],
)
def test_phrases_are_found_in_prose(
    line: str, phrases: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glossary, "REPOSITORY", tmp_path)
    (tmp_path / "a.md").write_text(f"One line.\n{line}\n")
    assert [(f.line, f.text) for f in glossary.phrases_of(Path("a.md"))] == [(2, p) for p in phrases]


def test_a_docstring_does_not_begin_as_a_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glossary, "REPOSITORY", tmp_path)
    (tmp_path / "a.py").write_text('"""What is here."""\ndef f():\n    """Whether it is."""\n')
    assert [(f.line, f.text) for f in glossary.riddles_of(Path("a.py"))] == [(1, '"""What')]


def test_class_names_occur_once() -> None:
    defined: dict[str, list[str]] = {}
    for root in ("gridslam", "cli", "tests"):
        for file in sorted((glossary.REPOSITORY / root).rglob("*.py")):
            for line in file.read_text(encoding="utf-8").splitlines():
                if line.startswith("class "):
                    name = line.removeprefix("class ").split("(")[0].split(":")[0]
                    defined.setdefault(name, []).append(str(file))
    twice = {name: files for name, files in defined.items() if len(files) > 1}
    assert not twice
