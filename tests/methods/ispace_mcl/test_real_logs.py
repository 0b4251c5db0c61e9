from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.logs import open_log
from gridslam.maps.wean import load_wean_map
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl


@pytest.mark.real_data
def test_the_robot_is_found_in_wean_hall_and_its_scans_lie_on_the_walls(data_dir: Path) -> None:
    method = IspaceMcl(IspaceMclConfig(), 100, load_wean_map(data_dir / "wean_hall" / "wean.dat.gz"))
    with open_log(data_dir / "wean_hall" / "robotdata1.log.gz") as log:
        for event in log.events():
            method.process(event)
    result = method.result()
    distances = result.series["wall_distance"].values
    late = len(distances) // 3
    assert np.nanmean(distances[late:]) <= 0.15
    assert result.series["inlier_ratio"].values[late:].mean() >= 0.8
    # Where the run of every seed ends: at the door of the furnished room, facing into it.
    np.testing.assert_allclose(result.trajectory.poses[-1], [39.9, 41.45, 1.3], atol=0.3)
    assert len(result.trajectory) == 713
