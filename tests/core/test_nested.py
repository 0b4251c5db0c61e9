from __future__ import annotations

from gridslam.core.nested import flatten


def test_nested_keys_are_joined_with_dots_in_the_order_of_the_document() -> None:
    flat = flatten({"b": {"y": 1, "x": {"deep": None}}, "a": "text"})
    assert list(flat.items()) == [("b.y", 1), ("b.x.deep", None), ("a", "text")]


def test_lists_are_values_and_empty_objects_have_no_key() -> None:
    assert flatten({"list": [1, {"a": 2}], "empty": {}}) == {"list": [1, {"a": 2}]}
