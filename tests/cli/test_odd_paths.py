"""Whatever lies where an input is expected, the command ends with an exit code for input or usage and one line."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from gridslam.cli.main import main
from tests.conftest import REPOSITORY

SAMPLES = REPOSITORY / "sample_logs"
LOG, TRUE_MAP = str(SAMPLES / "slam-sd.mcap"), str(SAMPLES / "ispace-mcl.truth" / "map.yaml")
PATH = str(SAMPLES / "slam-sd.truth" / "trajectory.tum")
DRAWING = str(REPOSITORY / "configs" / "worlds" / "drawings" / "corridor.png")
SLOTS: Mapping[str, tuple[str, ...]] = {
    "log": ("map", "ODD", "-c", "slam-sd", "-o", "OUT"),
    "config": ("map", LOG, "-c", "ODD", "-o", "OUT"),
    "truth": ("map", LOG, "-c", "slam-sd", "-o", "OUT", "--truth", "ODD"),
    "tags": ("map", LOG, "-c", "slam-sd", "-o", "OUT", "--tags", "ODD"),
    "drawing": ("map", LOG, "-c", "handmap-slam", "-o", "OUT", "--drawing", "ODD"),
    "continue": ("map", LOG, "-c", "slam-sd", "-o", "OUT", "--continue", "ODD"),
    "map": ("localize", str(SAMPLES / "ispace-mcl.mcap"), "-c", "ispace-mcl", "--map", "ODD", "-o", "OUT"),
    "result": ("evaluate", "ODD", "--truth", PATH),
    "true poses": ("evaluate", PATH, "--truth", "ODD"),
    "relations": ("evaluate", PATH, "--relations", "ODD"),
    "true objects": ("evaluate", PATH, "--truth", PATH, "--truth-objects", "ODD"),
    "true map": ("evaluate", PATH, "--truth", PATH, "--truth-map", "ODD"),
    "plan": ("plan", "ODD", "--start", "0,0,0", "--goal", "1,1"),
    "correlation": ("correlation", "ODD"),
    "world": ("simulate", "ODD", "-o", "OUT"),
    "explored world": ("explore", "ODD", "--drawing", DRAWING, "-o", "OUT"),
    "sweep": ("sweep", "ODD", "-o", "OUT"),
    "info": ("info", "ODD"),
    "convert": ("convert", "ODD", "OUT"),
    "maps": ("maps", "merge", TRUE_MAP, "ODD", "-o", "OUT.yaml"),
    "drawing show": ("drawing", "show", "ODD"),
}


@pytest.fixture(scope="module")
def odd_paths(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[str]]:
    """What may lie in the place of a file: devices, a pipe, a socket, a folder, links, names that are too long."""
    folder = tmp_path_factory.mktemp("odd", numbered=True)
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "loop").symlink_to("loop")
    (folder / "dangling").symlink_to("nothing")
    (folder / "empty.yaml").touch()
    with socket.socket(socket.AF_UNIX) as unix:
        unix.bind(os.path.relpath(folder / "socket"))
        names = (
            "folder",
            "pipe",
            "loop",
            "dangling",
            "socket",
            "nothing",
            "x" * 300,
            "folder/../pipe/x",
            "\x1b[31m\n",
            "\udcff",
        )
        yield [str(folder / name) for name in names] + ["/dev/zero", "/dev/null", "/proc/self/mem", "", "/"]


@pytest.mark.parametrize("slot", SLOTS)
def test_an_odd_path_ends_with_a_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, odd_paths: list[str], slot: str
) -> None:
    for path in odd_paths:
        arguments = [path if a == "ODD" else a.replace("OUT", str(tmp_path / "out")) for a in SLOTS[slot]]
        code, err = main(arguments), capsys.readouterr().err
        assert code in (2, 3, 4), (path, code, err)
        assert all(line.startswith("gridslam: ") and line.isprintable() for line in err.splitlines()), err
        assert err.splitlines()[-1].startswith("gridslam: error: ")
        assert list(tmp_path.iterdir()) == []
