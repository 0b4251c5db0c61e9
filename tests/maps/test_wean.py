from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import MapError
from gridslam.maps.load import load_any_map
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.wean import load_wean_map

TEXT = "-1 1 0\n0.25 -1 -1\n"


@pytest.mark.parametrize("packed", [False, True])
def test_lines_are_columns_and_numbers_are_probabilities_of_free(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "m"
    path.write_bytes(gzip.compress(TEXT.encode()) if packed else TEXT.encode())
    grid = load_wean_map(path)
    expected = np.array([[np.nan, 0.75], [0.0, np.nan], [1.0, np.nan]], np.float32)
    assert np.array_equal(grid.probability, expected, equal_nan=True)
    # x = 0.05 m is line 0, y = 0.25 m its third number
    assert grid.geometry.cells(np.array([[0.05, 0.25]])).tolist() == [[2, 0]]
    assert np.array_equal(load_any_map(path).probability, expected, equal_nan=True)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no map"),
        ("1 1\n1\n", "m:2: 1 numbers; expected 2"),
        ("1 1\n1 x\n", "m:2: "),
        ("1 1\n1 nan\n", "m:2: "),
        ("1 1\n1 2\n", "m:2: "),
        ("1 1\n-0.5 1\n", "m:2: "),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "m").write_text(text)
    with pytest.raises(MapError) as error:
        load_wean_map(tmp_path / "m")
    assert says in str(error.value)


def test_a_cut_packed_map_and_a_bomb_are_map_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cut").write_bytes(gzip.compress(TEXT.encode() * 1000)[:60])
    with pytest.raises(MapError, match="cut"):
        load_wean_map(tmp_path / "cut")
    monkeypatch.setattr("gridslam.maps.wean.MAX_TEXT_BYTES", 1000)
    (tmp_path / "bomb").write_bytes(gzip.compress(b"1 " * 10**6))
    with pytest.raises(MapError, match="bomb"):
        load_wean_map(tmp_path / "bomb")


def test_a_map_server_yaml_is_recognised_and_other_files_are_map_errors(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((2, 3), np.float32), GridGeometry(0.1, (0.0, 0.0)))
    yaml_path = save_map(grid, tmp_path / "map")
    assert load_any_map(yaml_path).probability.shape == (2, 3)
    with pytest.raises(MapError, match="image alone"):
        load_any_map(tmp_path / "map.pgm")
    with pytest.raises(MapError, match="a folder"):
        load_any_map(tmp_path)
    with pytest.raises(MapError, match="no such map"):
        load_any_map(tmp_path / "none")
    (tmp_path / "noise").write_bytes(bytes(range(256)))
    with pytest.raises(MapError, match="noise"):
        load_any_map(tmp_path / "noise")


@pytest.mark.real_data
def test_wean_hall_has_the_cells_of_the_file(data_dir: Path) -> None:
    path = data_dir / "wean_hall/wean.dat.gz"
    file = np.array(gzip.decompress(path.read_bytes()).split(), float).reshape(800, 800)
    grid = load_any_map(path)
    assert grid.geometry == GridGeometry(0.1, (0.0, 0.0))
    assert np.array_equal(np.isnan(grid.probability), file.T == -1)
    assert np.array_equal(grid.probability > 0.5, (file.T >= 0) & (file.T < 0.5))
