"""No command replaces a file that it reads, or a part of a map that it reads, also with --force."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from gridslam.cli.main import main
from gridslam.maps.map_server import load_map, save_map
from gridslam.report.directory import REPORT_FORMAT, REPORT_NAME
from gridslam.report.evaluation_page import DOCUMENT_NAME, PAGE_NAME
from tests.conftest import REPOSITORY
from tests.maps.test_editing import room

SAMPLES = REPOSITORY / "sample_logs"
LOG = str(SAMPLES / "ispace-mcl.mcap")
WORLD = "plan: {file: room.yaml}\nrobot: {start: [0, -3, 0], route: [[1, -3]]}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a map `room`, another one whose image has its own name, a run, and an evaluation."""
    save_map(room(), tmp_path / "room")
    text = save_map(room(), tmp_path / "picture").read_text()
    (tmp_path / "picture.yaml").unlink()
    (tmp_path / "named.yaml").write_text(text)
    (tmp_path / "world.yaml").write_text(WORLD)
    run, evaluation = tmp_path / "run", tmp_path / "evaluation"
    run.mkdir()
    (run / REPORT_NAME).write_text(json.dumps({"format": REPORT_FORMAT}))
    save_map(room(), run / "image")
    (tmp_path / "beside.yaml").write_text(text.replace("picture.pgm", "run/image.pgm"))
    (run / "mine.yaml").write_text("method: {name: slam-sd}\n")
    evaluation.mkdir()
    for name in (DOCUMENT_NAME, PAGE_NAME):
        (evaluation / name).touch()
    shutil.copy(SAMPLES / "ispace-mcl.truth" / "trajectory.tum", evaluation)
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        ["maps", "compare", "room.yaml", "named.yaml", "-o", "picture.pgm"],
        ["maps", "compare", "named.yaml", "room.yaml", "-o", "room.pgm"],
        ["maps", "export", "named.yaml", "-o", "picture.yaml"],
        ["maps", "crop", "named.yaml", "--reachable", "-1,2", "-o", "picture"],
        ["maps", "rotate", "named.yaml", "--yaw", "90", "-o", "picture.yaml"],
        ["maps", "merge", "room.yaml", "named.yaml", "--pose", "0,0,0", "-o", "picture.yaml"],
        ["correlation", "room.yaml", "-o", "room.pgm"],
        ["simulate", "world.yaml", "--preview", "room.pgm"],
        ["evaluate", "evaluation/trajectory.tum", "--truth", LOG, "-o", "evaluation"],
        ["evaluate", LOG, "--truth", "evaluation/trajectory.tum", "-o", "evaluation"],
        ["map", LOG, "-c", "run/mine.yaml", "-o", "run"],
        ["localize", LOG, "-c", "ispace-mcl", "--map", "beside.yaml", "-o", "run"],
        ["plan", "beside.yaml", "--start", "0,-3,0", "--goal", "1,-3,0", "-o", "run"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_an_output_that_would_replace_an_input_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    monkeypatch.chdir(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert main([*words, "--force"]) == 2
    assert "would replace the input" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_a_map_is_replaced_as_a_whole_where_its_own_name_is_given(folder: Path) -> None:
    path = folder / "room.yaml"
    assert main(["maps", "rotate", str(path), "--yaw", "90", "-o", str(path), "--force"]) == 0
    rows, cols = load_map(path).probability.shape
    assert rows > cols


def test_a_run_may_be_repeated_with_its_own_settings(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(folder / "run" / "mine.yaml", folder / "run" / "run.yaml")
    words = ["map", str(folder / "absent.mcap"), "-c", str(folder / "run" / "run.yaml")]
    assert main([*words, "-o", str(folder / "run"), "--force"]) == 3
    assert "would replace" not in capsys.readouterr().err
