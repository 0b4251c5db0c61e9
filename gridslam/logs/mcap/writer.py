"""Write events as an MCAP file of standard ROS 2 messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Literal

from gridslam.core.files import identity_of, partial_file, put_file, remove_left_over
from gridslam.core.messages import Event, Odometry
from gridslam.logs.encoding.encoded import Encoded
from gridslam.logs.kinds import TRUTH_TOPIC
from gridslam.logs.ros.encode import encode
from gridslam.logs.ros.types import ros2_types

_CHUNK_BYTES = 1 << 20


class McapWriter:
    """Writes events into an MCAP file that gets its name when `close` succeeds; the same events give the same bytes.

    `qos_profiles` by topic: rosbag2's text of the quality of service with which the topic was offered.
    """

    def __init__(
        self,
        path: str | Path,
        compression: Literal["zstd", "lz4", "none"] = "zstd",
        chunk_bytes: int = _CHUNK_BYTES,
        qos_profiles: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        from mcap.writer import CompressionType, Writer

        self._path = Path(path)
        self._aside = ExitStack()
        self._before = identity_of(self._path)
        self._stream = self._aside.enter_context(partial_file(self._path))
        remove_left_over(self._path)
        self._writer = Writer(
            self._stream, chunk_size=chunk_bytes, compression=CompressionType[compression.upper()]
        )
        self._qos_profiles = qos_profiles
        self._writer.start(profile="ros2", library="gridslam")
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._counts: dict[int, int] = {}
        self._is_complete = False

    def __enter__(self) -> McapWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._aside.__exit__(kind, error, trace)

    def write(self, event: Event, topic: str | None = None) -> None:
        """Append one event, on `topic` or the usual one of its kind."""
        for message in encode(event, topic):
            self.append(message)

    def write_truth(self, pose: Odometry) -> None:
        """Append the true pose, on the topic that no method is shown."""
        self.write(pose, TRUTH_TOPIC)

    def append(self, message: Encoded) -> None:
        """Append a message of any type of ROS 2 that is encoded already."""
        channel = self._channels.get((message.topic, message.type))
        if channel is None:
            qos = self._qos_profiles.get(message.topic)
            metadata = {} if qos is None else {"offered_qos_profiles": qos}
            channel = self._writer.register_channel(
                message.topic, "cdr", self._schema(message.type), metadata
            )
            self._channels[message.topic, message.type] = channel
        sequence = self._counts.get(channel, 0)
        self._counts[channel] = sequence + 1
        stamp = message.stamp_ns
        self._writer.add_message(channel, stamp, message.data, stamp, sequence & 0xFFFFFFFF)

    def complete(self) -> None:
        """Write what is left, so that only the name is missing; nothing may be appended from here on."""
        if not self._is_complete:
            self._is_complete = True
            finish: Callable[[], None] = self._writer.finish
            finish()
            self._stream.flush()

    def close(self) -> None:
        """Complete the file and give it its name."""
        if self._stream.closed:
            return
        with self._aside:
            self.complete()
            put_file(self._stream, self._path, self._before)

    def abandon(self) -> None:
        """Leave no file behind."""
        with suppress(OSError):  # what a full disk did not take is given up anyway
            self._aside.close()

    def _schema(self, name: str) -> int:
        if name not in self._schemas:
            text, _ = ros2_types().generate_msgdef(name, ros_version=2)
            self._schemas[name] = self._writer.register_schema(name, "ros2msg", text.encode())
        return self._schemas[name]
