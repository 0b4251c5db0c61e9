"""Recognition of the public datasets: the source for a folder that holds one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gridslam.logs.datasets.euroc import mav_folder, open_euroc
from gridslam.logs.datasets.kitti import is_kitti, open_kitti
from gridslam.logs.datasets.source import DatasetSource
from gridslam.logs.datasets.tum_rgbd import is_tum_rgbd, open_tum_rgbd


def open_dataset(folder: Path) -> DatasetSource | None:
    """The source of a folder of a known dataset; None for other folders. Raises LogError: it is damaged."""
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite then is counted as such
        if is_kitti(folder):
            return open_kitti(folder)
        if mav_folder(folder) is not None:
            return open_euroc(folder)
        if is_tum_rgbd(folder):
            return open_tum_rgbd(folder)
    return None
