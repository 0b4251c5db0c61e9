"""The page that sets our figures beside the papers'."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gridslam.sweep.config import SweepConfig, load_sweep
from gridslam.sweep.jobs import settings_of_sweep
from tests.conftest import REPOSITORY
from tests.papers.make import NAMES, module_of
from tests.papers.page import (
    Experiment,
    PagePicture,
    Section,
    empty_page,
    end,
    start_mark,
    with_section,
    write_section,
)
from tests.papers.work import SWEEPS, Work

WALLS = Experiment(
    "Walls", "How far walls are off.", [("mean, cm", 3.376, 3.0, None, "0 to 4")], short="Nothing."
)


def section_of(name: str, text: str, *experiments: Experiment) -> Section:
    return Section(name, name.upper(), text, experiments)


def test_an_experiment_is_a_sentence_a_table_and_what_falls_short() -> None:
    assert WALLS.markdown().splitlines() == [
        "### Walls",
        "",
        "How far walls are off.",
        "",
        "|  | the paper | gridslam, the paper's form | gridslam | seeds |",
        "| --- | --- | --- | --- | --- |",
        "| mean, cm | 3.38 | 3 | - | 0 to 4 |",
        "",
        "Nothing.",
    ]


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="2 values under 5 columns"):
        Experiment("Walls", "", [("mean", 1.0)]).markdown()


def test_a_section_is_replaced_and_the_others_are_kept() -> None:
    page = empty_page(["a", "b"])
    for name in ("a", "b"):
        page = with_section(page, section_of(name, f"text of {name}", WALLS))
    newer = section_of("a", "newer \\1 text")
    replaced = with_section(page, newer)
    assert "text of b" in replaced
    assert "newer \\1 text" in replaced
    assert "text of a" not in replaced
    assert with_section(replaced, newer) == replaced


def test_a_page_without_a_place_for_the_section_is_an_error() -> None:
    with pytest.raises(ValueError, match="0 places for c"):
        with_section(empty_page(["a"]), section_of("c", ""))


def test_pictures_lie_beside_the_page(tmp_path: Path) -> None:
    page = tmp_path / "docs" / "papers.md"
    page.parent.mkdir()
    rgb = np.zeros((2, 3, 3), np.uint8)
    rgb[0, 1] = (250, 20, 10)
    shown = Experiment("Walls", "", [], [PagePicture("walls", rgb, "The walls")])
    write_section(page, section_of("a", "", shown), ["a", "b"])
    assert "![The walls](images/papers-walls.png)" in page.read_text()
    assert f"{start_mark('b')}\n{end('b')}" in page.read_text()
    with Image.open(tmp_path / "docs" / "images" / "papers-walls.png") as picture:
        assert np.array_equal(np.asarray(picture), rgb)


@pytest.mark.parametrize("name", NAMES)
def test_every_paper_has_a_module_that_says_what_it_costs(name: str) -> None:
    module = module_of(name)
    assert 0.0 < module.CPU_MINUTES < 30.0
    assert callable(module.section)


def test_all_sections_together_cost_two_cores_half_an_hour_at_most() -> None:
    assert sum(module_of(name).CPU_MINUTES for name in NAMES) <= 60.0


def test_the_page_has_every_section_filled() -> None:
    page = (REPOSITORY / "docs" / "papers.md").read_text()
    for name in NAMES:
        text = page[page.index(start_mark(name)) : page.index(end(name))]
        assert "### " in text, name


@pytest.mark.parametrize("file", sorted(SWEEPS.glob("*.yaml")), ids=lambda file: file.stem)
def test_the_sweeps_are_valid(file: Path) -> None:
    sweep = load_sweep(file)
    assert len(settings_of_sweep(sweep, file.parent)) == len(sweep.configs) * len(sweep.overrides) * len(
        sweep.seeds
    )


def test_what_is_computed_for_a_seed_is_computed_once(tmp_path: Path) -> None:
    asked = []

    def square(seed: int) -> int:
        asked.append(seed)
        return seed * seed

    assert Work(tmp_path, max_seeds=2).each("squares", square, range(5)) == [0, 1]
    assert Work(tmp_path).each("squares", square, range(4)) == [0, 1, 4, 9]
    assert asked == [0, 1, 2, 3]
    (tmp_path / "squares" / "2.json").write_text('{"key": "of another program", "value": 7}')
    assert Work(tmp_path).each("squares", square, range(4)) == [0, 1, 4, 9]
    assert asked == [0, 1, 2, 3, 2]


def test_the_seeds_are_divided_among_processes(tmp_path: Path) -> None:
    assert Work(tmp_path, jobs=2).each("factorials", math.factorial, range(5)) == [1, 1, 2, 6, 24]


def test_a_sweep_gives_its_measures_by_log_config_and_override(tmp_path: Path, small_log: Path) -> None:
    document = {
        "command": "map",
        "logs": [{"name": "room", "log": str(small_log), "truth": str(small_log)}],
        "configs": {"best": "slam-sd"},
        "overrides": {"few": ["method.particles=3", "method.pose_graph.enabled=false"]},
        "seeds": "0..3",
    }
    sweep = SweepConfig.model_validate(document)
    found = Work(tmp_path, jobs=1, max_seeds=1).run(
        sweep, tmp_path, {"evaluate": {"align": "origin"}}, "part"
    )
    assert found.seeds == (0,)
    assert found.values("method.particles", "room", "best", "few").tolist() == [3.0]
    assert 0.0 < found.mean("ape.trans.rmse", "room", "best", "few") < 0.2
    assert found.cpu_s("room", "best", "few") > 0.0
    assert (found.directory("room", "best", "few", 0) / "map.png").exists()
    with pytest.raises(KeyError, match="room best default"):
        found.values("method.particles", "room", "best")
