"""At most ten measures are shown, the same ones in the same order."""

from __future__ import annotations

from gridslam.evaluation.headline import IMPORTANT, MAX_ROWS, ORDER, headline, unit_of


def test_every_important_measure_has_a_place_in_the_order() -> None:
    assert sorted(IMPORTANT) == sorted(ORDER)


def test_at_most_ten_measures_are_shown() -> None:
    document: dict[str, object] = {}
    for key in ORDER:
        section = document
        *path, name = key.split(".")
        for part in path:
            section = section.setdefault(part, {})  # type: ignore[assignment]
        section[name] = 1.0
    shown = headline(document)
    assert len(shown) == MAX_ROWS
    assert shown[0] == "ape.trans.rmse"
    assert headline({"relations": {"trans": {"mean": 0.1}}, "other": 1.0}) == ["relations.trans.mean"]


def test_units_belong_to_keys() -> None:
    assert unit_of("ape.trans.rmse") == "m"
    assert unit_of("map.accuracy.var") == "m^2"
    assert unit_of("map.accuracy.count") == ""
    assert unit_of("kitti.t_rel") == "%"
