"""Several logs as one map: the same as continuing run by run, and clear errors for wrong use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from gridslam.api import localize, map_log
from gridslam.core.errors import ConfigError, InputError, MapError
from gridslam.logs.config import LogConfig
from gridslam.logs.convert import convert_log
from gridslam.logs.open import open_log
from gridslam.runs import several_logs
from gridslam.runs.run import Run, run_map
from gridslam.runs.run_config import RunConfig
from tests.conftest import REPOSITORY

LOG = REPOSITORY / "sample_logs" / "slam-sd.mcap"


@pytest.fixture(scope="module")
def halves(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The sample log cut into two drives that overlap."""
    folder = tmp_path_factory.mktemp("drives")
    paths = [folder / "monday.mcap", folder / "thursday.mcap"]
    for path, (start, end) in zip(paths, ((0.0, 40.0), (25.0, 65.0)), strict=True):
        with open_log(LOG, LogConfig()) as log:
            convert_log(log, path, start_s=start, end_s=end)
    return paths


def test_two_logs_are_mapped_as_one_continued_run_after_the_other(halves: list[Path], tmp_path: Path) -> None:
    both = map_log(halves, "slam-sd")
    run = map_log(halves[0], "slam-sd").save(tmp_path / "monday")
    continued = map_log(halves[1], "slam-sd", session=run)
    assert both.map is not None and continued.map is not None
    np.testing.assert_array_equal(both.map.probability, continued.map.probability)
    assert both.run.result.files == continued.run.result.files
    assert [row[1] for row in both.tables["drives"].rows] == [path.name for path in halves]
    folder = both.save(tmp_path / "both")
    names = {path.name for path in folder.iterdir()}
    assert {"session.npz", "changes.png", "changes.csv", "trajectory_1.tum", "trajectory_2.tum"} <= names
    assert (np.diff(both.trajectory.stamps_ns) > 0).all()
    assert len(both.trajectory) > len(map_log(halves[0], "slam-sd").trajectory)


def test_localizing_in_a_session_shows_where_the_place_differs(halves: list[Path], tmp_path: Path) -> None:
    run = map_log(halves[0], "slam-sd").save(tmp_path / "monday")
    found = localize(halves[0], run, "ispace-mcl", start=[0.0, 0.0, 0.0])
    layer = found.layers["disagreement"]
    assert set(np.unique(layer)) <= {-1, 0, 1}
    assert np.count_nonzero(layer) < 20
    assert found.tables["disagreement"].columns[0] == "state"
    with pytest.raises(InputError, match=r"session.npz: cannot be read"):
        localize(halves[0], tmp_path, "ispace-mcl")
    alone = tmp_path / "session.npz"
    alone.write_bytes((run / "session.npz").read_bytes())
    with pytest.raises(MapError, match="no such map"):
        localize(halves[0], alone, "ispace-mcl")
    alone.write_bytes(b"nothing")
    with pytest.raises(InputError, match="not a session"):
        localize(halves[0], alone, "ispace-mcl")


def test_wrong_use_ends_with_a_clear_error(halves: list[Path], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="ir-scan maps one log"):
        map_log(halves, "ir-scan")
    with pytest.raises(ConfigError, match="--continue FILE: ir-scan has no use"):
        map_log(halves[0], "ir-scan", session=tmp_path)
    with pytest.raises(ConfigError, match=r"--continue .*: has no session.npz; give the directory of a run"):
        map_log(halves[0], "slam-sd", session=tmp_path)
    (tmp_path / "session.npz").write_bytes(b"nothing")
    with pytest.raises(InputError, match="not a session"):
        map_log(halves[0], "slam-sd", session=tmp_path)
    with pytest.raises(ConfigError, match="has this log already"):
        map_log([halves[0], halves[0]], "slam-sd")
    with pytest.raises(ConfigError, match="loop closure"):
        map_log(halves, "slam-sd", pose_graph={"enabled": False})


def test_an_interruption_before_the_first_scan_of_a_drive_keeps_the_map_of_those_before(
    halves: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_but_the_second(config: RunConfig[BaseModel], path: Path, *others: Any) -> Run:
        show, _, inputs = others
        return run_map(config, path, show, lambda: path == halves[1], inputs)

    alone = map_log(halves[0], "slam-sd")
    monkeypatch.setattr(several_logs, "run_map", run_but_the_second)
    found = map_log(halves, "slam-sd")
    assert found.run.status == "interrupted"
    np.testing.assert_array_equal(found.trajectory.stamps_ns, alone.trajectory.stamps_ns)
    assert found.run.result.files == alone.run.result.files
