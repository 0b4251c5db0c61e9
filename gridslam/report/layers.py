"""layers.npz: map layers with their geometry; the same values give the same bytes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.files import write_atomic
from gridslam.maps.occupancy import GridGeometry, GridLayer

EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date of the zip format; np.savez would write the present time


def write_layers(path: Path, layers: Mapping[str, GridLayer]) -> None:
    """Write `NAME` `(rows, cols)` (lower-left cell first), `NAME.origin` (x, y, yaw) and `NAME.resolution` of each layer.

    `numpy.load(path)` reads the file.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=4) as archive:
        for name in sorted(layers):
            for key, values in (
                (name, layers[name].values),
                (f"{name}.origin", _origin(layers[name].geometry)),
                (f"{name}.resolution", np.float64(layers[name].geometry.resolution_m)),
            ):
                _add(archive, key, np.asarray(values))
    write_atomic(path, buffer.getvalue())


def _origin(geometry: GridGeometry) -> NDArray[np.float64]:
    return np.array([*geometry.origin_xy_m, geometry.yaw_rad], dtype=np.float64)


def _add(archive: zipfile.ZipFile, name: str, values: NDArray[np.generic]) -> None:
    entry = zipfile.ZipInfo(f"{name}.npy", EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    data = io.BytesIO()
    np.lib.format.write_array(data, np.asarray(values, order="C"), allow_pickle=False)
    archive.writestr(entry, data.getvalue())
