"""gridslam drawing show, from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gridslam.cli.main import main


@pytest.fixture
def drawing(tmp_path: Path) -> Path:
    picture = np.full((120, 200), 255, np.uint8)
    picture[20:100, 30:170] = 0
    picture[23:97, 33:167] = 255
    Image.fromarray(picture).save(tmp_path / "drawing.png")
    return tmp_path / "drawing.png"


def test_a_reading_is_printed_and_drawn_and_never_over_another(
    drawing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["drawing", "show", str(drawing), "-o", str(tmp_path / "read.png")]
    assert main(command) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:6] == ["size", "20", "x", "12", "drawing", "units,"]
    assert any(line.split() == ["walls", "dark"] for line in lines)
    with Image.open(tmp_path / "read.png") as picture:
        assert picture.width >= 700
    assert main(command) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0


def test_a_reading_is_one_json_document(drawing: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["drawing", "show", str(drawing), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["size"] == [20.0, 12.0]
    assert document["ignored"] == {"texts": 0, "arrows": 0, "specks": 0}
    assert not document["is_open"] and not document["perspective_undone"]


def test_what_is_no_picture_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "drawing.png").write_text("walls")
    assert main(["drawing", "show", str(tmp_path / "drawing.png")]) == 3
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert main(["drawing", "show", str(tmp_path / "none.png")]) == 3
