"""Write events as a rosbag2 folder: an MCAP file and the metadata.yaml with which `ros2 bag play` opens it."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import yaml

from gridslam.core.errors import ConfigError
from gridslam.core.files import check_name, identity_of, partial_folder, put_folder, real_path, write_atomic
from gridslam.core.messages import Event, Odometry
from gridslam.logs.kinds import TRUTH_TOPIC
from gridslam.logs.mcap.writer import McapWriter
from gridslam.logs.ros.encode import encode

METADATA = "metadata.yaml"
METADATA_VERSION = 5  # that of ROS 2 Humble; later releases read it too
LATCHED_QOS = """- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
QOS_PROFILES = {"/tf_static": LATCHED_QOS}  # later subscribers receive its messages as well


class Rosbag2Writer:
    """Writes events into a folder that gets its name when `close` succeeds; the same events give the same bytes.

    Raises ConfigError: the path exists and is not a rosbag2 folder, or it is one and `force` is not set.
    """

    def __init__(self, path: str | Path, force: bool = False) -> None:
        self._path = real_path(Path(path))
        check_rosbag2_free(Path(path), force)
        self._before = identity_of(self._path)
        self._aside = ExitStack()
        self._folder = self._aside.enter_context(partial_folder(self._path))
        self._file_name = f"{self._path.name}_0.mcap"
        self._writer = McapWriter(self._folder / self._file_name, qos_profiles=QOS_PROFILES)
        self._counts: Counter[tuple[str, str]] = Counter()  # by topic and type
        self._span_ns: tuple[int, int] | None = None

    def __enter__(self) -> Rosbag2Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def write(self, event: Event, topic: str | None = None) -> None:
        """Append one event, on `topic` or the default topic of its kind."""
        for message in encode(event, topic):
            self._counts[message.topic, message.type] += 1
            first, last = self._span_ns or (message.stamp_ns, message.stamp_ns)
            self._span_ns = min(first, message.stamp_ns), max(last, message.stamp_ns)
            self._writer.append(message)

    def write_truth(self, pose: Odometry) -> None:
        """Append a true pose, on the topic that methods do not read."""
        self.write(pose, TRUTH_TOPIC)

    def complete(self) -> None:
        """Write the rest of the log under its temporary name. Nothing may be appended afterwards."""
        self._writer.close()
        write_atomic(self._folder / METADATA, self._metadata().encode())

    def close(self) -> None:
        """Complete the folder, and give it its final name."""
        with self._aside:
            self.complete()
            put_folder(self._folder, self._path, self._before)

    def abandon(self) -> None:
        """Remove what was written."""
        self._writer.abandon()
        self._aside.close()

    def _metadata(self) -> str:
        first, last = self._span_ns or (0, 0)

        def span() -> dict[str, object]:
            return {
                "duration": {"nanoseconds": last - first},
                "starting_time": {"nanoseconds_since_epoch": first},
                "message_count": sum(self._counts.values()),
            }

        topics = [
            {
                "topic_metadata": {
                    "name": topic,
                    "type": kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": QOS_PROFILES.get(topic, ""),
                },
                "message_count": count,
            }
            for (topic, kind), count in sorted(self._counts.items())
        ]
        recording = {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            **span(),
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._file_name],
            "files": [{"path": self._file_name, **span()}],
        }
        return yaml.safe_dump({"rosbag2_bagfile_information": recording}, sort_keys=False, allow_unicode=True)


def check_rosbag2_free(path: Path, force: bool) -> None:
    """Raise ConfigError unless a rosbag2 folder may be written here: at a new path, or over an earlier one with `force`."""
    check_name(path)
    if not path.exists():
        if not real_path(path).parent.is_dir():
            raise ConfigError(f"{path}: cannot be written: {real_path(path).parent} is not a folder")
        return
    if path.is_dir() and not any(path.iterdir()):
        return
    if not (path / METADATA).is_file():
        raise ConfigError(
            f"{path}: exists and is not a rosbag2 folder, so it is never replaced; choose another name"
        )
    if not force:
        raise ConfigError(f"{path}: exists; choose another name or use --force")
