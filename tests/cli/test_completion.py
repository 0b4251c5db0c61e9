"""Names that the shell completes."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.cli.completion import complete_config, complete_world


def test_built_in_names_and_yaml_files_are_completed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("slam-mine.yaml", "slam.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "slam-old").mkdir()
    assert complete_config("slam") == ["slam-sd", "slam-mine.yaml", "slam-old/"]
    assert "office" in complete_world("off")
    assert complete_config("[") == []
