from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.config.yaml_file import MAX_ALIASES, MAX_BYTES, parse_mapping, parse_value, read_yaml
from gridslam.core.errors import ConfigError


def test_a_mapping_is_read_with_its_types(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text("a: {b: 1, c: 2.5, d: [x, true]}\n")
    assert read_yaml(file) == {"a": {"b": 1, "c": 2.5, "d": ["x", True]}}


def test_an_empty_file_is_an_empty_mapping(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text("# nothing\n")
    assert read_yaml(file) == {}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: 1\nb: [\n", "a.yaml, line 3"),
        ("a: 1\nb: 2\na: 3\n", "a.yaml, line 3: not valid YAML: the key 'a' is given twice"),
        ("m: {x: 1,\n x: 2}\n", "line 2: not valid YAML: the key 'x' is given twice"),
        ("- 1\n", "expected `key: value` lines, found list"),
        ("a: !!python/object/apply:os.system [id]\n", "could not determine a constructor"),
        ("a: 1\n---\nb: 2\n", "not valid YAML"),
        ("a: \0\n", "not valid YAML"),
        ("[" * 10_000, "nested deeper"),
    ],
)
def test_what_is_no_mapping_is_refused_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"a\.yaml") as error:
        read_yaml(file)
    assert says in str(error.value)


def test_an_alias_bomb_is_refused_before_it_unfolds() -> None:
    levels = [f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 30)}]" for i in range(1, 9)]
    with pytest.raises(ConfigError, match=f"more than {MAX_ALIASES} aliases"):
        parse_mapping("\n".join(["l0: &l0 [x]", *levels]), "bomb")


def test_a_merge_key_may_be_overridden_once() -> None:
    assert parse_mapping("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}", "text")["b"] == {"x": 1, "y": 3}


def test_a_huge_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_bytes(b"#" * (MAX_BYTES + 1))
    with pytest.raises(ConfigError, match="larger than"):
        read_yaml(file)


def test_bytes_that_are_not_text_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_bytes(b"a: \xff\xfe\n")
    with pytest.raises(ConfigError, match="byte 3 is not UTF-8"):
        read_yaml(file)


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="a folder"):
        read_yaml(tmp_path)
    with pytest.raises(ConfigError, match="No such file"):
        read_yaml(tmp_path / "none.yaml")


def test_single_values_are_parsed_as_yaml() -> None:
    assert parse_value("[1, 2.5]", "--set") == [1, 2.5]
    assert parse_value("true", "--set") is True
    assert parse_value("", "--set") is None
