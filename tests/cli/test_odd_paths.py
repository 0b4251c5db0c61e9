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


@pytest.mark.parametrize("name", [".", "..", "/", "", "..yaml", "folder/..yaml"])
@pytest.mark.parametrize(
    "command",
    [
        ("maps", "crop", TRUE_MAP, "--polygon", "0,0 1,0 1,1", "-o", "OUT"),
        ("simulate", "sd-corridor-short", "-o", "OUT"),
        ("simulate", "sd-corridor-short", "--preview", "OUT"),
    ],
)
def test_an_output_without_a_name_of_its_own_ends_with_a_line(
    command: tuple[str, ...],
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if command[0] == "simulate" and name.endswith("yaml"):
        pytest.skip("a name for a log and a picture")
    (tmp_path / "here" / "folder").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    assert main([name if word == "OUT" else word for word in command]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gridslam: error: ")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
