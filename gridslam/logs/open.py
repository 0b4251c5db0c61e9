"""Open a log of any format; the format is recognised by content."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.log import Log
from gridslam.logs.streams import Source

READABLE = (
    "MCAP, a folder of CSV files, CARMEN text, a rosbag2 folder or .db3, a ROS 1 .bag, a Wean Hall text log, "
    "a folder of KITTI odometry, EuRoC or TUM RGB-D, an MRPT rawlog, HDF5"
)

MAX_NAMED = 5  # largest number of logs of a folder that an error names


def open_log(path: str | Path, config: LogConfig | None = None, kinds: Collection[str] | None = None) -> Log:
    """Open a log and index it. Indexing finds its streams, counts their messages, and notices most damage.

    `kinds` are the kinds of streams that will be read (`scan`, `odom`, ...). If a method takes one stream of a kind and the log
    has several, `config.topics` must name one. Without `kinds`, all streams are played back.

    Raises LogError: the file is not a readable log. Raises ConfigError: the config must name a topic.
    """
    config = config or LogConfig()
    path = Path(path)
    try:
        return Log(path, _source(path, config), config, kinds)
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror or error})") from error


def _source(path: Path, config: LogConfig) -> Source:
    """The reader for what the file's first bytes say it is."""
    if not path.exists():
        raise LogError(f"{path}: no such file or folder")
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            from gridslam.logs.rosbag.rosbag2 import open_rosbag2

            return open_rosbag2(path, config)
        from gridslam.logs.csv.source import LAYOUT_FILE, open_csv_folder

        if config.csv is None and not (path / LAYOUT_FILE).is_file() and (source := _parts(path, config)):
            return source
        if config.csv is None and not (path / LAYOUT_FILE).is_file():
            from gridslam.logs.datasets.open import open_dataset

            if (dataset := open_dataset(path)) is not None:
                return dataset
            _refuse_folder_of_logs(path)
        return open_csv_folder(path, config)
    if not path.is_file():
        raise LogError(f"{path}: a pipe or a device; logs are read more than once: save it to a file first")
    with path.open("rb") as stream:
        magic = stream.read(16)
    if magic.startswith(b"\x89MCAP"):
        from gridslam.logs.mcap.source import open_mcap

        return open_mcap(path, config)
    if magic.startswith((b"SQLite format 3\0", b"\x28\xb5\x2f\xfd")):  # the latter: packed with zstd
        from gridslam.logs.rosbag.rosbag2 import open_rosbag2

        return open_rosbag2(path, config)
    if magic.startswith(b"#ROSBAG V"):
        from gridslam.logs.rosbag.rosbag1 import open_rosbag1

        return open_rosbag1(path, config)
    if magic.startswith(b"\x89HDF\r\n\x1a\n"):
        from gridslam.logs.csv.source import open_hdf5

        return open_hdf5(path, config)
    return _text_source(path, config)


def _refuse_folder_of_logs(folder: Path) -> None:
    """Raise LogError: the folder is not a log itself, but holds some."""
    from gridslam.logs.find import logs_inside

    inside = logs_inside(folder)
    if inside != [folder]:
        names = ", ".join(path.name for path in inside[:MAX_NAMED]) + (
            ", ..." if len(inside) > MAX_NAMED else ""
        )
        raise LogError(f"{folder}: a folder with {len(inside)} logs: {names}; name one of them")


def _parts(folder: Path, config: LogConfig) -> Source | None:
    """The parts of a rosbag2 recording in a folder without metadata.yaml; None if there are none."""
    from gridslam.logs.rosbag.parts import numbered_files, why_several
    from gridslam.logs.rosbag.rosbag2 import open_rosbag2

    files = numbered_files(folder)
    if reason := why_several(files):
        raise LogError(
            f"{folder}: holds {len(files)} recordings, not the parts of one: {reason}; name one of them"
        )
    return open_rosbag2(folder, config) if files else None


def _text_source(path: Path, config: LogConfig) -> Source:
    from gridslam.logs.carmen.lines import looks_like_carmen
    from gridslam.logs.carmen.source import CarmenSource
    from gridslam.logs.carmen.wean_hall import WeanHallSource, looks_like_wean_hall
    from gridslam.logs.foreign import advice_for
    from gridslam.logs.text import beginning

    text = beginning(path)
    if text[:1] >= b"\x80":
        from gridslam.logs.datasets.rawlog import is_rawlog, open_rawlog

        if is_rawlog(text):
            return open_rawlog(path)
    if looks_like_carmen(text):
        return CarmenSource(path, config)
    if looks_like_wean_hall(text):
        return WeanHallSource(path, config)
    if config.csv is not None:
        from gridslam.logs.csv.source import open_table

        return open_table(path, config)
    if (advice := advice_for(path, text)) is not None:
        raise LogError(f"{path}: {advice}")
    what = "empty" if not path.stat().st_size else "no log of a known format"
    raise LogError(f"{path}: {what}; readable are {READABLE}")
