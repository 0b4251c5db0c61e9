"""layers.npz: map layers with their geometry; the same values give the same bytes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.files import write_atomic
from gridslam.core.numpy_files import npz_bytes
from gridslam.maps.occupancy import GridGeometry, GridLayer


def write_layers(path: Path, layers: Mapping[str, GridLayer]) -> None:
    """Write `NAME` `(rows, cols)` (lower-left cell first), `NAME.origin` (x, y, yaw) and `NAME.resolution` of each layer.

    `numpy.load(path)` reads the file.
    """
    arrays: dict[str, NDArray[np.generic]] = {}
    for name in sorted(layers):
        arrays[name] = np.asarray(layers[name].values)
        arrays[f"{name}.origin"] = _origin(layers[name].geometry)
        arrays[f"{name}.resolution"] = np.asarray(np.float64(layers[name].geometry.resolution_m))
    write_atomic(path, npz_bytes(arrays.items()))


def _origin(geometry: GridGeometry) -> NDArray[np.float64]:
    return np.array([*geometry.origin_xy_m, geometry.yaw_rad], dtype=np.float64)
