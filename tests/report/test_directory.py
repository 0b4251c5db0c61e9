from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.report.directory import check_free, is_run_directory, new_run_directory
from tests.conftest import REPOSITORY


def write_marked(folder: Path, mark: str) -> None:
    (folder / "report.json").write_text('{"format": "gridslam run"}')
    (folder / "mark").write_text(mark)


def test_the_folder_appears_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "out"
    with new_run_directory(target) as folder:
        write_marked(folder, "new")
        assert folder.parent == target.parent
        assert not target.exists()
    assert (target / "mark").read_text() == "new"
    assert is_run_directory(target)
    assert [p.name for p in target.parent.iterdir()] == ["out"]


def test_a_failure_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), new_run_directory(tmp_path / "out") as folder:
        write_marked(folder, "new")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_an_old_run_is_replaced_only_with_force(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with new_run_directory(target) as folder:
        write_marked(folder, "old")
    with pytest.raises(ConfigError, match="--force"), new_run_directory(target):
        pass
    with new_run_directory(target, force=True) as folder:
        write_marked(folder, "new")
        assert (target / "mark").read_text() == "old"
    assert (target / "mark").read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_the_old_run_is_kept_when_the_new_one_fails(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with new_run_directory(target) as folder:
        write_marked(folder, "old")
    with pytest.raises(RuntimeError), new_run_directory(target, force=True):
        raise RuntimeError
    assert (target / "mark").read_text() == "old"


@pytest.mark.parametrize("content", [{"notes.txt": "mine"}, {"report.json": "[1, 2]"}, {"report.json": "{"}])
def test_a_folder_that_is_not_a_run_is_never_replaced(tmp_path: Path, content: dict[str, str]) -> None:
    target = tmp_path / "out"
    target.mkdir()
    for name, text in content.items():
        (target / name).write_text(text)
    with pytest.raises(ConfigError, match="not a run"), new_run_directory(target, force=True):
        pass
    assert sorted(p.name for p in target.iterdir()) == sorted(content)


def test_a_file_of_that_name_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(ConfigError, match="not a run"):
        check_free(tmp_path / "out", force=True)


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    target = tmp_path / "out"
    target.mkdir()
    with new_run_directory(target) as folder:
        write_marked(folder, "new")
    assert (target / "mark").read_text() == "new"


def test_a_link_to_a_run_remains_a_link(tmp_path: Path) -> None:
    with new_run_directory(tmp_path / "real") as folder:
        write_marked(folder, "old")
    (tmp_path / "link").symlink_to("real")
    with new_run_directory(tmp_path / "link", force=True) as folder:
        write_marked(folder, "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "mark").read_text() == "new"


def test_a_file_in_place_of_a_folder_above_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="file is not a folder"):
        check_free(tmp_path / "file" / "out", force=False)


def test_permissions_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with new_run_directory(tmp_path / "out") as folder:
            write_marked(folder, "new")
    finally:
        os.umask(before)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o750


def test_a_kill_in_the_middle_leaves_nothing_under_the_name(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path\n"
        "from gridslam.report.directory import new_run_directory\n"
        "with new_run_directory(Path(sys.argv[1])) as folder:\n"
        "    (folder / 'map.pgm').write_text('half'); print('half', flush=True); time.sleep(60)\n"
    )
    command = [sys.executable, "-c", code, tmp_path / "out"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=REPOSITORY, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "half\n"
    (half,) = tmp_path.iterdir()
    make_old(half)
    with new_run_directory(tmp_path / "out") as folder:
        write_marked(folder, "beside")
    assert half.is_dir()  # its writer is at work
    shutil.rmtree(tmp_path / "out")
    child.send_signal(signal.SIGKILL)
    child.communicate(timeout=10)
    assert list(tmp_path.iterdir()) == [half]
    with new_run_directory(tmp_path / "out") as folder:
        write_marked(folder, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def make_old(folder: Path) -> None:
    an_hour_ago = time.time() - 3600.0
    os.utime(folder, (an_hour_ago, an_hour_ago))


def test_only_left_overs_of_the_same_place_are_removed(tmp_path: Path) -> None:
    kept = [
        ".other.abcdefgh.partial",
        ".out.2.abcdefgh.partial",
        ".out.abc.partial",
        "out.abcdefgh.partial",
        ".out",
    ]
    for name in (*kept, ".out.abcdefgh.partial", ".out.hgfedcba.old"):
        (tmp_path / name).mkdir()
        make_old(tmp_path / name)
    (tmp_path / ".out.newnewne.partial").mkdir()
    with new_run_directory(tmp_path / "out") as folder:
        write_marked(folder, "new")
    left = {p.name for p in tmp_path.iterdir()}
    assert left == {*kept, "out", ".out.newnewne.partial", ".out.hgfedcba.old"}
    with new_run_directory(tmp_path / "out", force=True) as folder:
        write_marked(folder, "newer")
    assert ".out.hgfedcba.old" not in {p.name for p in tmp_path.iterdir()}  # a run stands in its place


def test_a_name_without_room_for_the_temporary_one_is_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="longer than"):
        check_free(tmp_path / ("x" * 250), force=False)


def test_a_run_that_holds_an_input_of_the_new_one_is_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with new_run_directory(target) as folder:
        write_marked(folder, "old")
    with pytest.raises(ConfigError, match=r"would replace the input .*log\.mcap"):
        check_free(target, True, [target / "log.mcap"])
    check_free(target, True, [tmp_path / "log.mcap"])


def test_a_place_that_takes_no_files_is_refused_before_the_run() -> None:
    with pytest.raises(ConfigError, match=r"/proc/run: cannot be written .*; choose another output folder"):
        check_free(Path("/proc/run"), force=False)


def test_a_full_disk_is_refused_before_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gridslam.report.directory.MIN_FREE_BYTES", 1 << 62)
    with pytest.raises(ConfigError, match=r"MB are free there"):
        check_free(tmp_path / "run", force=False)


@pytest.mark.parametrize("earlier", [False, True])
def test_of_two_runs_into_one_folder_at_once_one_is_kept_and_the_other_is_reported(
    tmp_path: Path, earlier: bool
) -> None:
    target = tmp_path / "out"
    if earlier:
        with new_run_directory(target) as folder:
            write_marked(folder, "earlier")
    before = check_free(target, force=True)
    with new_run_directory(target, force=True) as folder:
        write_marked(folder, "first")
    with (
        pytest.raises(ConfigError, match="another process has written it meanwhile"),
        new_run_directory(target, True, before) as folder,
    ):
        write_marked(folder, "second")
    assert (target / "mark").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
