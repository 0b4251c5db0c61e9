"""gridslam maps: files that other programs read, and clear errors."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gridslam.cli.main import main
from gridslam.maps.map_server import load_map, save_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from tests.maps.test_editing import room, walls


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return save_map(room(), tmp_path / "room")


def test_a_cropped_and_a_turned_map_are_written(path: Path, tmp_path: Path) -> None:
    for words in (["crop", "--reachable", "-1,2"], ["rotate", "--yaw", "90"], ["rotate"]):
        assert (
            main(["maps", words[0], str(path), *words[1:], "-o", str(tmp_path / "new.yaml"), "--force"]) == 0
        )
    assert load_map(tmp_path / "new.yaml").geometry.resolution_m == 0.05


def test_two_overlapping_maps_are_merged_by_their_walls(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    grid = room()
    grid.probability[30:34, 70:110] = grid.probability[60:75, 20:30] = grid.probability[70:73, 90:125] = 0.95
    path = save_map(grid, tmp_path / "furnished")
    x, y = grid.geometry.origin_xy_m
    other = OccupancyGrid(grid.probability[:, :140], GridGeometry(0.05, (x + 3.0, y - 1.0), 0.4))
    second = save_map(other, tmp_path / "other")
    code = main(["maps", "merge", str(path), str(second), "-o", str(tmp_path / "both.yaml")])
    assert code == 0, capsys.readouterr().err
    whole = load_map(tmp_path / "both.yaml")
    assert abs(len(walls(whole)) - len(walls(grid))) < 0.3 * len(walls(grid))
    capsys.readouterr()
    arguments = ["maps", "compare", str(path), str(second), "-o", str(tmp_path / "both.png"), "--json"]
    assert main(arguments) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["map.accuracy.mean"] < 0.05
    with Image.open(tmp_path / "both.png") as picture:
        assert picture.size == (160, 100)


def test_contours_and_pictures_are_exported_in_metres(path: Path, tmp_path: Path) -> None:
    for kind in ("svg", "dxf", "png"):
        assert main(["maps", "export", str(path), "-o", str(tmp_path / f"out.{kind}")]) == 0
    text = (tmp_path / "out.dxf").read_text().split("\n")
    pairs = dict(zip(text[::2], text[1::2], strict=False))
    assert pairs["0"] == "EOF"
    corners = np.array([float(v) for code, v in zip(text[::2], text[1::2], strict=False) if code == "10"])
    low, high = walls(room()).min(axis=0), walls(room()).max(axis=0)
    assert corners[corners != 0.0].min() == pytest.approx(low[0] - 0.025, abs=0.02)
    assert corners.max() == pytest.approx(high[0] + 0.025, abs=0.02)
    svg = (tmp_path / "out.svg").read_text()
    assert re.search(r'viewBox="-2.0000 -6.0000 8.0000 5.0000"', svg)


def test_a_geotiff_lies_where_its_origin_says(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "out.tif"
    assert main(["maps", "export", str(path), "-o", str(file)]) == 2
    assert (
        main(
            [
                "maps",
                "export",
                str(path),
                "-o",
                str(file),
                "--epsg",
                "32633",
                "--geo-origin",
                "500000,5000000",
            ]
        )
        == 0
    )
    with Image.open(file) as picture:
        tags = dict(picture.tag_v2)  # type: ignore[attr-defined]
    assert tags[33550] == (0.05, 0.05, 0.0)
    assert tags[33922] == pytest.approx((0.0, 0.0, 0.0, 499998.0, 5000006.0, 0.0))
    assert tags[34735][-1] == 32633


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_the_modes_of_map_server_are_read_back(path: Path, tmp_path: Path, mode: str) -> None:
    assert main(["maps", "export", str(path), "-o", str(tmp_path / "new.yaml"), "--mode", mode]) == 0
    read, grid = load_map(tmp_path / "new.yaml"), room()
    np.testing.assert_array_equal(np.isnan(read.probability), np.isnan(grid.probability))
    assert len(walls(read)) == len(walls(grid))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["crop", "MAP"], "either --polygon or --reachable"),
        (["crop", "MAP", "--polygon", "0,0 1,1"], "at least three corners"),
        (["crop", "MAP", "--polygon", "0,0 1,x 2,2"], "2 numbers"),
        (["rotate", "MAP", "--yaw", "nan"], "degrees"),
        (["export", "MAP", "--mode", "raw"], "expected a name"),
    ],
)
def test_wrong_use_is_one_line(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    arguments = [str(path) if word == "MAP" else word for word in words]
    assert main(["maps", *arguments, "-o", str(tmp_path / "x.abc")]) == 2
    assert says in capsys.readouterr().err
