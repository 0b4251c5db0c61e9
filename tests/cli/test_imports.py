from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = {"numba", "cv2", "scipy", "matplotlib", "rosbags", "PIL", "numpy", "rich", "yaml"}
REPORT = "import json, sys; json.dump(sorted(sys.modules), sys.stderr)"


def modules_after(*arguments: str | Path) -> set[str]:
    """The modules that a command line has imported."""
    run = f"code = main({[str(a) for a in arguments]!r})"
    code = f"from gridslam.cli.main import main; {run}; {REPORT}; sys.exit(code)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stderr))


@pytest.mark.parametrize("arguments", [["--help"], ["map", "--help"], ["config", "--help"], ["--version"]])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    modules = modules_after(*arguments)
    assert not modules & HEAVY
    assert len(modules) < 400


def test_info_imports_no_heavy_library(small_log: Path) -> None:
    modules = modules_after("info", small_log)
    assert not modules & {"numba", "cv2", "scipy", "matplotlib", "rosbags"}


def test_checking_a_config_imports_no_method(small_log: Path) -> None:
    modules = modules_after("config", "check", "slam-sd")
    assert not modules & {"numba", "cv2", "scipy", "matplotlib", "rosbags"}
