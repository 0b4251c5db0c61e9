"""What a folder of CSV files may replace, and what it keeps of events or refuses."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import ConfigError, LogError
from gridslam.core.messages import Event, Image, Imu, LaserScan, Odometry, Range, TagInventory, Transform
from gridslam.logs import open_log, open_writer, write_log
from gridslam.logs.convert import convert_log
from gridslam.logs.csv_layout import MAX_TABLES
from tests.conftest import REPOSITORY
from tests.logs.mutations import fingerprint

S = 10**9
ODOMETRY = Odometry(S, "odom", 1.0, 2.0, 0.5)


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def read(path: Path) -> list[Event]:
    with open_log(path) as log:
        return [event for event in log.events() if not isinstance(event, Transform)]


@pytest.mark.parametrize(
    "names",
    [
        ["notes.txt"],
        ["odom.csv"],
        ["log.yaml", "notes.txt"],
        ["log.yaml", "laser.csv"],
        ["log.yaml", "odom.csv", "kept/odom.csv"],
        ["log.yaml", "odom.csv", "image_left/notes.txt"],
        [".git/config", "log.yaml"],
    ],
)
def test_force_replaces_nothing_but_what_the_writer_makes(tmp_path: Path, names: list[str]) -> None:
    target = tmp_path / "out"
    for name in names:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (target / name).write_text("mine")
    before = content(target)
    with pytest.raises(ConfigError, match="never replaced"):
        write_log(target, [ODOMETRY], force=True)
    assert content(target) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_force_replaces_a_log_of_every_kind_of_file(tmp_path: Path) -> None:
    target = tmp_path / "out"
    picture = Image(S, "cam", np.zeros((2, 2), np.uint8), "left")
    turning = Range(S, "ir", 0.5, 1.0, 0.1, 2.0)
    with open_writer(target) as writer:
        for topic in ("/a", "/b"):
            writer.write(ODOMETRY, topic)
        writer.write(picture)
        writer.write(turning)
    assert {"odom.csv", "odom_2.csv", "image.csv", "range.csv", "log.yaml"} < set(content(target))
    write_log(target, [ODOMETRY], force=True)
    assert set(content(target)) == {"odom.csv", "log.yaml"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["out", "out.mcap"])
def test_a_folder_and_a_file_do_not_replace_each_other(tmp_path: Path, name: str) -> None:
    target = tmp_path / name
    if name == "out":
        target.write_text("mine")
    else:
        target.mkdir()
    with pytest.raises(ConfigError, match="never replaced"):
        write_log(target, [ODOMETRY], force=True)
    assert target.exists()


def test_a_link_to_a_log_remains_a_link(tmp_path: Path) -> None:
    write_log(tmp_path / "real", [ODOMETRY])
    (tmp_path / "link").symlink_to("real")
    write_log(tmp_path / "link", [ODOMETRY, ODOMETRY], force=True)
    assert (tmp_path / "link").is_symlink()
    assert len(read(tmp_path / "real")) == 2


@pytest.mark.parametrize("output", ["log", "log.mcap", "folder"])
def test_a_conversion_does_not_replace_the_log_that_it_reads(tmp_path: Path, output: str) -> None:
    source = tmp_path / output
    if output == "folder":
        write_log(source, [ODOMETRY])
        source = source / "log.mcap"
    write_log(source, [ODOMETRY])
    before = content(tmp_path)
    with open_log(source) as log, pytest.raises(ConfigError, match="would replace the input"):
        convert_log(log, tmp_path / output, force=True)
    assert content(tmp_path) == before


def test_a_full_disk_leaves_nothing_even_when_the_rest_cannot_be_flushed(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from gridslam.core.messages import Odometry; from gridslam.logs import open_writer\n"
        "with open_writer(Path(sys.argv[1])) as writer:\n"
        "    for n in range(10**5): writer.write(Odometry(n, 'odom', 1.5, 2.5, 0.5))\n"
    )
    done = [
        subprocess.run(
            [sys.executable, "-c", code, tmp_path / name],
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            timeout=60,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)),
        )
        for name in ("out", "out.mcap")
    ]
    assert [run.returncode for run in done] == [1, 1]
    assert all(f"File too large: '{tmp_path}/out" in run.stderr.splitlines()[-1] for run in done)
    assert list(tmp_path.iterdir()) == []


def scan(n: int, frame: str) -> LaserScan:
    return LaserScan(n * S, frame, np.full(3 + n, 1.5, np.float32), -1.0, 0.5, 0.125, 30.0)


@pytest.mark.parametrize(
    "events",
    [
        [scan(1, "front"), scan(2, "front"), scan(3, "rear, left"), scan(4, "front")],
        [Imu(S, "a", 0.5), Imu(2 * S, "b", 0.25)],
        [
            ODOMETRY,
            Odometry(2 * S, "odom", 0.0, 0.0, 0.0, child_frame_id="cart"),
            Odometry(3 * S, "map", 0.0, 0.0, 0.0),
        ],
    ],
)
def test_frames_that_differ_within_a_stream_are_kept_in_one_stream(
    tmp_path: Path, events: list[Event]
) -> None:
    for output in (tmp_path / "log", tmp_path / "log.mcap"):
        with open_writer(output) as writer:
            for event in events:
                writer.write(event, "/topic")
    with open_log(tmp_path / "log.mcap") as log:
        convert_log(log, tmp_path / "converted")
    for path in (tmp_path / "log", tmp_path / "converted"):
        with open_log(path) as log:
            assert [info.topic for info in log.streams] == ["/topic"]
        assert list(map(fingerprint, read(path))) == list(map(fingerprint, events))


def test_rows_name_their_frames_only_where_they_differ(tmp_path: Path) -> None:
    write_log(tmp_path / "one", [scan(1, "front"), scan(2, "front")])
    write_log(tmp_path / "two", [scan(1, "front"), scan(2, "rear")])
    heads = [(tmp_path / name / "scan.csv").read_text().splitlines()[0] for name in ("one", "two")]
    assert "frame" not in heads[0]
    assert ",frame,r0" in heads[1]


def tags(antenna: str = "left", *ids: str, stamp_s: int = 1, frame: str = "base") -> TagInventory:
    return TagInventory(stamp_s * S, frame, antenna, ids, (-40.5,) * len(ids))


@pytest.mark.parametrize(
    ("events", "says"),
    [
        ([tags("left", "x\ny")], r"'x\\ny'"),
        ([tags("left", " sp ")], "' sp '"),
        ([tags("left\n")], r"'left\\n'"),
        ([tags("left", "x", "", "z")], "without an id"),
        ([tags("left", "")], "without an id"),
        ([tags("left", "\ud800")], "ud800"),
        ([tags("left", "x"), tags("left", "y")], "two messages of antenna 'left' with stamp 1.000000000"),
        ([Range(S, "ir\n", 0.0, 1.0, 0.1, 2.0)], r"'ir\\n'"),
        ([Image(S, "cam ", np.zeros((2, 2), np.uint8), "left")], "'cam '"),
        ([Transform(S, "a\r\nb", "c", (0, 0, 0), (1, 0, 0, 0))], r"'a\\r\\nb'"),
        ([Imu(S, "a", 0.5), Imu(S, " b", 0.5)], "' b'"),
    ],
)
def test_what_a_row_cannot_hold_is_refused_by_its_value_and_leaves_nothing(
    tmp_path: Path, events: list[Event], says: str
) -> None:
    with pytest.raises(LogError, match=says) as error:
        write_log(tmp_path / "out", events)
    assert "OUT.mcap" in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_inventories_that_follow_each_other_read_back_as_they_are(tmp_path: Path) -> None:
    events = [
        tags("left", "a b", 'quo"te', "c,d"),
        tags("right", "x"),
        tags("right"),
        tags("right"),
        tags("right", "y"),
        tags("left", "x"),
        tags("left", "x", stamp_s=2),
    ]
    write_log(tmp_path / "out", events)
    assert list(map(fingerprint, read(tmp_path / "out"))) == list(map(fingerprint, events))


def test_more_streams_than_a_folder_can_have_tables_are_refused_and_leave_nothing(tmp_path: Path) -> None:
    with (
        pytest.raises(LogError, match=r"more than 500 streams.*OUT\.mcap"),
        open_writer(tmp_path / "out") as w,
    ):
        for n in range(MAX_TABLES + 1):
            w.write(Odometry(n, "odom", 0.0, 0.0, 0.0), f"/odom{n}")
    assert list(tmp_path.iterdir()) == []


def test_pictures_of_one_stamp_have_files_of_their_own(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2), np.uint8)
    with open_writer(tmp_path / "out") as writer:
        for stamp_ns in (5, 5, 5, 7, 5):
            writer.write(Image(stamp_ns, "c", pixels, "cam"))
    names = sorted(path.name for path in (tmp_path / "out" / "image_cam").iterdir())
    assert [name.lstrip("0") for name in names] == ["5.png", "5_2.png", "5_3.png", "5_4.png", "7.png"]
