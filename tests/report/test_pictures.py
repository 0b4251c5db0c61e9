"""Maps and pictures that a method hands over beside its map."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from gridslam.maps.map_server import load_map
from gridslam.methods.base import Picture
from gridslam.report.write import write_run
from gridslam.runs.run import Run


def test_pictures_lie_beside_the_map_and_in_the_report(finished_run: Run, tmp_path: Path) -> None:
    rgb = np.zeros((4, 6, 3), np.uint8)
    rgb[0, 5] = (200, 10, 30)
    run = replace(
        finished_run,
        result=replace(finished_run.result, pictures={"raw": Picture(rgb, "Raw points", "all of them")}),
    )
    write_run(run, tmp_path / "run")
    png = (tmp_path / "run/raw.png").read_bytes()
    with Image.open(tmp_path / "run/raw.png") as picture:
        assert np.array_equal(np.asarray(picture), rgb)
    page = (tmp_path / "run/report.html").read_text()
    assert base64.b64encode(png).decode() in page
    assert "Raw points" in page
    assert "all of them" in page


def test_further_maps_are_saved_under_their_names(finished_run: Run, tmp_path: Path) -> None:
    assert finished_run.result.occupancy is not None
    run = replace(
        finished_run, result=replace(finished_run.result, maps={"static": finished_run.result.occupancy})
    )
    write_run(run, tmp_path / "run")
    saved, further = load_map(tmp_path / "run/map.yaml"), load_map(tmp_path / "run/static.yaml")
    assert np.array_equal(saved.probability, further.probability, equal_nan=True)
