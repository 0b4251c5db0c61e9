from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import Field, ValidationError

from gridslam.config.base import StrictModel
from gridslam.config.errors import MAX_VALUE_LENGTH, config_error, nearest, short


class Near(StrictModel):
    kind: Literal["near"] = "near"
    range_m: float = Field(1.0, gt=0.0)


class Far(StrictModel):
    kind: Literal["far"] = "far"
    range_m: float = 1.0


class Inner(StrictModel):
    value: int = 0


class Outer(StrictModel):
    model: Annotated[Near | Far, Field(discriminator="kind")] = Near()
    inner: Inner | None = None
    by_name: dict[str, Inner] = Field(default_factory=dict)
    listed: list[Inner] = Field(default_factory=list)
    text: str | list[str] = ""
    layout: Inner | str | None = None
    needed: int


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ({}, "needed: this key is missing"),
        ({"neded": 1}, "neded: no such key (did you mean 'needed'?)"),
        ({"value": 1}, "value: no such key (did you mean 'inner.value'?)"),
        (
            {"model": {"kind": "near", "rnge_m": 1}},
            "model.rnge_m: no such key (did you mean 'range_m'?)",
        ),
        ({"model": {"kind": "far", "rang_m": 1}}, "model.rang_m: no such key (did you mean 'range_m'?)"),
        (
            {"model": {"kind": "near", "range_m": 0}},
            "model.range_m: input should be greater than 0, got 0",
        ),
        ({"model": {"kind": "middle"}}, "model.kind: expected 'near', 'far', got 'middle'"),
        ({"model": {}}, "model: the key 'kind' is missing"),
        ({"model": 3}, "model: "),
        ({"inner": {"valu": 1}}, "inner.valu: no such key (did you mean 'value'?)"),
        ({"inner": {"value": 1.5}}, "inner.value: input should be a valid integer"),
        ({"by_name": {"a": {"valu": 1}}}, "by_name.a.valu: no such key (did you mean 'value'?)"),
        ({"by_name": 3}, "by_name: expected a section with keys, got 3"),
        ({"listed": [{}, {"valu": 1}]}, "listed.1.valu: no such key (did you mean 'value'?)"),
        (
            {"text": 3},
            "text: input should be a valid string, got 3; text: input should be a valid list, got 3",
        ),
        ({"layout": {"valu": 1}}, "layout.valu: no such key (did you mean 'value'?)"),
        (
            {"zebra": 1, "needed": 1},
            "zebra: no such key (known: by_name, inner, layout, listed, model, needed, text)",
        ),
    ],
)
def test_an_error_names_the_key_as_the_user_wrote_it(document: dict[str, object], says: str) -> None:
    with pytest.raises(ValidationError) as error:
        Outer.model_validate(document)
    assert says in str(config_error(error.value, Outer, "file.yaml"))


def test_only_the_first_errors_are_reported_and_the_rest_counted() -> None:
    with pytest.raises(ValidationError) as error:
        Outer.model_validate({f"key{i}": 0 for i in range(9)})
    message = str(config_error(error.value, Outer, "file.yaml"))
    assert message.count(";") == 5
    assert message.endswith("and 5 more")


def test_long_values_are_cut() -> None:
    with pytest.raises(ValidationError) as error:
        Inner.model_validate({"value": "x" * 1000})
    assert len(str(config_error(error.value, Inner, "file.yaml"))) < 200


def test_a_value_that_unfolds_to_gigabytes_is_shown_in_a_few_words() -> None:
    value: list[object] = ["x"]
    for _ in range(40):
        value = [value] * 9
    assert len(short(value)) <= MAX_VALUE_LENGTH


def test_a_text_of_usual_length_is_shown_in_full() -> None:
    path = "a/folder/somewhere/with/a/file/in/it.yaml"
    assert short(path) == repr(path)


def test_nearest_lists_the_choices_where_none_is_near() -> None:
    assert nearest("slam-ds", ["slam-sd", "ir-scan"]) == " (did you mean 'slam-sd'?)"
    assert nearest("zzz", ["b", "a"]) == " (known: a, b)"
    assert nearest("zzz", []) == ""
