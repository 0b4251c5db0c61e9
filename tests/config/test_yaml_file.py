from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.config.yaml_file import MAX_BYTES, MAX_REPEATED, parse_mapping, parse_value, read_yaml
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
        ("a: !!python/object/apply:os.system [id]\n", "tags are not allowed"),
        ("a: 1\n---\nb: 2\n", "not valid YAML"),
        ("a: \0\n", "not valid YAML"),
        ('a: 1\nb: {"\\ud800": 2}\n', "line 2: not valid YAML: a text with a zero or half a character"),
        ('a: "x\\0"\n', "line 1: not valid YAML: a text with a zero"),
        ("a: 1_000\n", "line 1: not valid YAML: the number 1_000: write it without"),
        ("a: [0, 1_0.5]\n", "the number 1_0.5: write it without"),
        ("a: 1:30\n", "the number 1:30: write it without"),
        ("a: 010\n", "the number 010: write it without"),
        ("[" * 10_000, "nested deeper"),
    ],
)
def test_what_is_no_mapping_is_refused_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"a\.yaml") as error:
        read_yaml(file)
    assert says in str(error.value)


def bomb(levels: int, aliases: int) -> str:
    lines = [f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * aliases)}]" for i in range(1, levels)]
    return "\n".join(["l0: &l0 [x]", *lines])


@pytest.mark.parametrize(("levels", "aliases"), [(9, 30), (12, 9), (30, 2)])
def test_an_alias_bomb_is_refused_before_it_unfolds(levels: int, aliases: int) -> None:
    with pytest.raises(ConfigError, match=f"repeat more than {MAX_REPEATED} values"):
        parse_mapping(bomb(levels, aliases), "bomb")


def test_aliases_may_repeat_what_is_small_as_often_as_wanted() -> None:
    document = parse_mapping("a: &a {x: 1, y: [2, 3]}\nb: [" + "*a, " * 1000 + "]\n", "text")
    assert document["b"] == [{"x": 1, "y": [2, 3]}] * 1000


@pytest.mark.parametrize(
    "text",
    [
        "&d\nlog: *d\n",
        "a: &x [*x]",
        "a: &x {b: {c: [*x, *x]}}",
        "a: &x {<<: *x}",
        "l0: &l0 [x]\n" + "\n".join(f"l{i}: &l{i} [*l{i - 1}]" for i in range(1, 60)),
    ],
)
def test_aliases_that_go_deep_or_round_in_a_circle_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="nested deeper than 50 by its aliases"):
        parse_mapping(text, "circle")


@pytest.mark.parametrize("kind", ["!!int", "!!float", "!!bool", "!!timestamp", "!!binary", "!!str", "!mine"])
@pytest.mark.parametrize("value", ["''", "foo", "[]", "5"])
def test_tags_are_refused_whatever_they_stand_at(kind: str, value: str) -> None:
    with pytest.raises(ConfigError, match="tags are not allowed"):
        parse_mapping(f"a: 1\nb: {kind} {value}\n", "text")


@pytest.mark.parametrize(
    "value", [":".join(["1", *["59"] * 250]), "0x" + "f" * 6000, "9" * 5000, "1" + ":59" * 250 + ".5"]
)
def test_numbers_that_no_float_can_hold_are_refused(value: str) -> None:
    with pytest.raises(ConfigError, match="text"):
        parse_mapping(f"a: {value}\n", "text")


@pytest.mark.parametrize("value", ["2020-13-45", "2020-02-30t10:00:00Z", "2020-01-01t10:00:00+99:99"])
def test_dates_that_there_are_not_are_refused(value: str) -> None:
    with pytest.raises(ConfigError, match="text"):
        parse_mapping(f"a: {value}\n", "text")


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
