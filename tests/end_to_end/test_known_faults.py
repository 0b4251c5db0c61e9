"""Inputs with one fault each: what is said about them, and what the result is worth."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gridslam.cli.main import main
from gridslam.core.errors import MapError, MethodError
from gridslam.maps.load import load_any_map
from gridslam.runs.run import Run, run_map
from gridslam.runs.run_config import load_config

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"


@pytest.fixture
def cases(cases_dir: Path) -> Path:
    return cases_dir / "companion"


@pytest.mark.parametrize("name", ["thresh_pct", "thresh_255"])
def test_thresholds_that_would_make_all_cells_free_are_refused(cases: Path, name: str) -> None:
    with pytest.raises(MapError, match="occupied_thresh: expected a number from 0 to 1"):
        load_any_map(cases / "maps" / f"{name}.yaml")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("free025", "200 cells of grey 205 are read as unknown"),
        ("scale", "200 cells of grey 205 are read as unknown"),
        ("raw_on_trinary_image", "mode raw makes 880 cells of grey 0 free"),
        ("rgba_alpha250", "9600 cells are unknown because their pixels have an alpha"),
        ("origin_deg", "the yaw 90 is read as radians"),
    ],
)
def test_an_unusual_map_gets_a_remark(
    cases: Path, name: str, says: str, caplog: pytest.LogCaptureFixture
) -> None:
    load_any_map(cases / "maps" / f"{name}.yaml")
    assert says in caplog.text


@pytest.mark.parametrize("name", ["free025", "scale", "mode_upper"])
def test_unknown_cells_remain_unknown(cases: Path, name: str) -> None:
    assert np.isnan(load_any_map(cases / "maps" / f"{name}.yaml").probability).sum() == 200


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("wfirst.tum", "level if the quaternions are written w first"),
        ("yaw_deg.txt", "degrees?"),
        ("optical.tum", "the motion leaves the plane"),
        ("mm.tum", "is the estimate in millimetres?"),
        ("mirror.tum", "the estimate is mirrored"),
        ("off2s.tum", "--time-offset -2.00"),
        ("partial_overlap.tum", "only 50 of 200 poses are paired (25%)"),
        ("otherframe.tum", "--align se2"),
        ("allsame.tum", "all stamps of allsame.tum are the same"),
        ("zero_epoch.tum", "--time-offset 1311875572.000"),
        ("kitti.txt", "has no stamps"),
    ],
)
def test_the_cause_of_a_large_error_is_named(
    cases: Path, name: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = cases / "trajectories"
    evaluate(folder / name, folder / "truth.tum")
    captured = capsys.readouterr()
    assert says in captured.out + captured.err


@pytest.mark.parametrize("name", ["kitti.txt", "euroc.csv"])
def test_other_formats_give_the_same_errors(
    cases: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = cases / "trajectories"
    tables = []
    for file in ("est.tum", name):
        assert evaluate(folder / file, folder / "truth.tum") == 0
        tables.append(capsys.readouterr().out.partition("remark")[0])
    assert tables[0] == tables[1]


def evaluate(path: Path, truth: Path) -> int:
    try:
        main(["evaluate", str(path), "--truth", str(truth)])
    except SystemExit as done:
        return int(done.code or 0)
    return 0


MapStereo = Callable[[str], Run]


@pytest.fixture
def map_stereo(cases: Path, tmp_path: Path) -> MapStereo:
    def run(name: str) -> Run:
        log = Path(shutil.copy(cases / "stereo" / f"{name}.mcap", tmp_path))
        return run_map(load_config("stereo-bayes"), log, lambda progress: None, lambda: False)

    return run


@pytest.mark.parametrize(
    ("name", "says"), [("zeroP_both", "not calibrated"), ("no_baseline", "gives no baseline")]
)
def test_a_stereo_pair_without_calibration_is_an_error(map_stereo: MapStereo, name: str, says: str) -> None:
    with pytest.raises(MethodError, match=says):
        map_stereo(name)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("half_both", "was scaled to 120 x 90"),
        ("info_mm", "taken as millimetres, 0.12 m is used"),
        ("vert3", "+3.0 rows lower"),
        ("swapped", "are exchanged"),
        ("c_png16", ""),
        ("mono16", ""),
        ("bayer_rggb8", ""),
    ],
)
def test_a_repaired_stereo_pair_gives_the_right_map(map_stereo: MapStereo, name: str, says: str) -> None:
    run = map_stereo(name)
    assert [line for line in run.problems if says in line] if says else not run.problems
    assert run.result.occupancy is not None
    grid, true = run.result.occupancy, load_any_map(SAMPLES / "stereo-bayes.truth" / "map.yaml")
    free = true.geometry.cells(grid.geometry.centres(np.argwhere(grid.probability < 0.35)))
    assert len(free) > 1500
    assert (true.probability[free[:, 0], free[:, 1]] < 0.35).mean() > 0.95
