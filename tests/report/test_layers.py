from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from gridslam.maps.occupancy import GridGeometry, GridLayer
from gridslam.report.layers import write_layers


def test_numpy_reads_the_layers_with_their_geometry(tmp_path: Path) -> None:
    values = np.arange(6, dtype=np.float32).reshape(2, 3)[:, ::-1]
    write_layers(tmp_path / "l.npz", {"hits": GridLayer(values, GridGeometry(0.05, (1.5, -2.25), 0.5))})
    with np.load(tmp_path / "l.npz", allow_pickle=False) as read:
        assert sorted(read.files) == ["hits", "hits.origin", "hits.resolution"]
        assert np.array_equal(read["hits"], values)
        assert read["hits"].dtype == np.float32
        assert read["hits.origin"].tolist() == [1.5, -2.25, 0.5]
        assert float(read["hits.resolution"]) == 0.05


def test_the_bytes_do_not_depend_on_the_time_or_the_order(tmp_path: Path) -> None:
    geometry = GridGeometry(0.1, (0.0, 0.0))
    a, b = (GridLayer(np.full((3, 3), v), geometry) for v in (1.0, 2.0))
    write_layers(tmp_path / "1.npz", {"a": a, "b": b})
    write_layers(tmp_path / "2.npz", {"b": b, "a": a})
    assert (tmp_path / "1.npz").read_bytes() == (tmp_path / "2.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "1.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
