"""An open log: its streams, its events in order, its truth, and counts of what was lost."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.core.plain_files import sha256_of
from gridslam.core.poses import MAX_COORDINATE_M
from gridslam.core.stamps import END_NS, NS_PER_S
from gridslam.core.trajectory import Trajectory
from gridslam.logs.config import LogConfig
from gridslam.logs.kind_lookup import unusable_reason
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order import ordering
from gridslam.logs.order.clocks import check_overlap, find_silent_lidars, restamp
from gridslam.logs.order.disorder import note_disorder
from gridslam.logs.order.repeats import COPIED, has_copies, is_looped, without_repeats
from gridslam.logs.placement.levelling import without_floor
from gridslam.logs.placement.sensor_placement import place_sensors
from gridslam.logs.placement.several_sensors import note_choice
from gridslam.logs.playback import Playback, file_states, true_pose_of
from gridslam.logs.selection import select_streams
from gridslam.logs.skips import Skip, SkipReason
from gridslam.logs.streams import Source, StreamInfo
from gridslam.logs.tum import read_trajectory


class Log:
    """An open log; use it as a context manager. `path` is the opened path, `format` the recognised format."""

    def __init__(self, path: Path, source: Source, config: LogConfig, kinds: Collection[str] | None) -> None:
        self.path = path
        self.format = source.format
        self.compression = source.compression
        self._source = source
        self._config = config
        self._selection = select_streams(source.streams, config, kinds, source.base_frame)
        # Faults of streams that the method does not read are not losses; tf concerns every method.
        self._concerned = None if kinds is None else {*kinds, "tf", "unknown"}
        self._for_a_method = kinds is not None  # a conversion keeps what was recorded
        self._playback = MessageCounts()
        self._opening = MessageCounts()
        self._truth = MessageCounts()
        self._restamped: frozenset[int] = frozenset()
        self._has_copies = has_copies(source.streams, self._selection.kind_of)
        if self._for_a_method:
            self._restamped = restamp(source.streams, self._selection.kind_of, self._opening)
            check_overlap(source.streams, self._selection.kind_of, self._opening)
            find_silent_lidars(source.streams, self._selection.kind_of, self._opening)
        self._sensors = place_sensors(source, self._selection, config, self._for_a_method, self._opening)
        self._file_states = file_states(source.files)
        note_disorder(source.streams, self._selection, self._is_sorted, self._opening)
        if self._for_a_method:
            note_choice(source.streams, self._selection.kind_of, config, self._opening)

    def as_read_for(self, kinds: Collection[str]) -> Log:
        """This log, opened for a method that takes these kinds: with its checks and repairs. Raises the errors of `open_log`.

        Both share their streams: if stamps are replaced for the method, they change in this log as well.
        """
        return Log(self.path, self._source, self._config, kinds)

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close open files, and free the messages kept in memory."""
        self._source.close()

    @property
    def config(self) -> LogConfig:
        """The settings that the log was opened with."""
        return self._config

    @property
    def streams(self) -> list[StreamInfo]:
        """All streams of the log, sorted by kind, then topic. Messages that `events()` has found unusable are not counted."""
        return [self._info(index) for index in self._selection.listed]

    def streams_in_span(self) -> list[StreamInfo]:
        """The streams that a method can read, with the counts and stamps between `start_s` and `end_s` of the config."""
        first, last = self._span_ns()
        return [
            self._info(index, first, last)
            for index in self._selection.listed
            if self._source.streams[index].kind != "other"
        ]

    @property
    def base_frame(self) -> str:
        """The robot's frame, which odometry moves and sensors are mounted on."""
        return self._selection.base_frame

    @property
    def sensor_extrinsics(self) -> list[Transform]:
        """The static transforms with which `events()` begins: one per sensor frame in use."""
        return list(self._sensors.fixed)

    @property
    def static_transforms(self) -> list[Transform]:
        """All static transforms of the log."""
        return list(self._source.static_edges)

    @property
    def start_ns(self) -> int:
        """The first stamp of the log, from which `--start` and `--end` count."""
        stamps = [info.first_stamp_ns for info in self.streams if info.first_stamp_ns is not None]
        return min(stamps, default=0)

    @property
    def has_span(self) -> bool:
        """Whether the config selects a part of the log."""
        return self._config.start_s is not None or self._config.end_s is not None

    def _span_ns(self) -> tuple[int, int]:
        """First and last stamp (ns) of the part that the config selects. Raises ConfigError: the log ends before it."""
        start_s, end_s = self._config.start_s, self._config.end_s
        if not self.has_span:
            return 0, END_NS
        last = max((info.last_stamp_ns or 0 for info in self.streams), default=0)
        first = self.start_ns + round((start_s or 0.0) * NS_PER_S)
        if first > last:
            raise ConfigError(
                f"{self.path}: log.start_s {start_s:g}: the log has only {(last - self.start_ns) / NS_PER_S:.1f} s"
            )
        return first, END_NS if end_s is None else self.start_ns + round(end_s * NS_PER_S)

    @property
    def event_count(self) -> int:
        """The largest number of events that `events()` yields, for progress."""
        return len(self._sensors.fixed) + sum(
            len(self._source.streams[i].stamps_ns) for i in self._selection.kind_of
        )

    @property
    def counters(self) -> dict[str, int]:
        """Message counts by key: `read.<kind>`, `skipped.<kind>.<reason>`, `lost.<what>`, `out_of_order.<kind>`,
        `equal_stamps.<kind>` and `unused.<kind>`. Counts of events are those of the current or last pass of `events()`.
        """
        return dict(sorted(self._account().counters.items()))

    @property
    def problems(self) -> list[str]:
        """Lines for the user: what was lost, where it was lost first, and what was assumed."""
        return self._account().problems

    @property
    def is_lossy(self) -> bool:
        """Whether something in the log could not be used."""
        return self._account().is_lossy

    @property
    def has_findings(self) -> bool:
        """Whether something in the log contradicts itself, or had to be assumed; `problems` says what."""
        return self._account().has_findings

    def input_hashes(self) -> dict[str, str]:
        """SHA-256 of each file of the log, by its name inside the log."""
        root = self.path if self.path.is_dir() else self.path.parent
        hashes = {}
        for file in self._source.files:
            name = file.relative_to(root) if file.is_relative_to(root) else file
            hashes[str(name)] = sha256_of(file)
        return dict(sorted(hashes.items()))

    def events(self) -> Iterator[Event]:
        """The static transforms, then the messages of all used streams, merged by stamp; each call starts at the beginning."""
        for _, event in self.events_by_topic():
            yield event

    def events_by_topic(self) -> Iterator[tuple[str, Event]]:
        """All pairs (topic, event), in the order of `events`; static transforms have the topic `/tf_static`."""
        for _, topic, event in self.events_by_stream():
            yield topic, event

    def events_by_stream(self, with_truth: bool = False) -> Iterator[tuple[str, str, Event]]:
        """All triples (kind, topic, event), in the order of `events`; static transforms have `tf` and `/tf_static`.

        `with_truth` adds the true poses, of kind `truth`; a conversion of the log needs them.
        """
        self._playback = message_counts = MessageCounts()
        for transform in self._sensors.fixed:
            message_counts.counters["read.extrinsics"] += 1
            yield "tf", "/tf_static", transform
        kind_of = dict(self._selection.kind_of)
        if with_truth and self._selection.truth is not None:
            kind_of[self._selection.truth] = "truth"
        items = Playback(
            path=self.path,
            source=self._source,
            kind_of=kind_of,
            states=self._file_states,
            message_counts=message_counts,
            by_stamp=self._is_sorted,
            limit_bytes=self._config.limits.reorder_mb << 20,
            lidars=self._sensors.virtual_lidars,
            with_repairs=self._for_a_method,
            restamped=self._restamped,
            span_ns=self._span_ns(),
            sweep_s=self._config.sweep_s,
        ).events()
        if self._for_a_method and is_looped(self._source.streams, self._selection.kind_of):
            items = without_repeats(items, message_counts)
        elif self._for_a_method and self._has_copies:
            items = without_repeats(items, message_counts, COPIED)
        for kind, topic, event in items:
            if isinstance(event, LaserScan) and (moving := self._sensors.moving.get(event.frame_id)):
                transform, event = moving.placed(event)
                yield "tf", "/tf", transform
            elif isinstance(event, LaserScan) and (tilted := self._sensors.tilted.get(event.frame_id)):
                event = without_floor(event, tilted)
            yield kind, topic, event

    def truth(self) -> Trajectory | None:
        """The true trajectory: topic `log.truth`, else `trajectory.tum` beside the log; None without either.

        Poses of the topic that cannot be used are counted. Raises InputError: a line of the file is wrong.
        """
        index = self._selection.truth
        if index is None:
            return self._truth_beside()
        self._truth = message_counts = MessageCounts()
        stream = self._source.streams[index]
        stamps, poses = [], []
        for _, event in self._source.read(frozenset({index}), [index] * len(stream.stamps_ns)):
            pose = true_pose_of(event)
            reason = _unusable_truth(event, pose)
            if pose is not None and reason is None:
                stamps.append(pose.stamp_ns)
                poses.append((pose.x_m, pose.y_m, pose.yaw_rad))
            elif reason is not None:
                message_counts.count(f"skipped.truth.{reason.value}")
        if self._concerned is not None:
            for key, number in self._source.message_counts.counters.items():
                if key.startswith("skipped.truth."):
                    message_counts.count(key, number)
        if left_out := sum(message_counts.counters.values()):
            message_counts.note(
                f"{stream.label}: {left_out} true poses cannot be used, and errors are measured without them"
            )
        return Trajectory(np.array(stamps, np.int64), np.array(poses, np.float64).reshape(-1, 3))

    def _truth_beside(self) -> Trajectory | None:
        file = self.path.parent / f"{self.path.name.removesuffix('.mcap')}.truth" / "trajectory.tum"
        return read_trajectory(file) if file.is_file() else None

    @property
    def _is_sorted(self) -> bool:
        return (self._config.order or self._source.order) == "stamp"

    def _info(self, index: int, first_ns: int | None = None, last_ns: int = END_NS) -> StreamInfo:
        """A stream as shown to the user; with `first_ns`, only its messages from `first_ns` to `last_ns`."""
        stream = self._source.streams[index]
        all_stamps: Sequence[int] = stream.stamps_ns
        if first_ns is not None:
            all_stamps = [stamp for stamp in all_stamps if first_ns <= stamp <= last_ns]
        stamps = all_stamps if stream.kind != "other" else None
        is_truth = index == self._selection.truth
        return StreamInfo(
            kind="truth" if is_truth else self._selection.kind_of.get(index, stream.kind),
            topic=stream.topic,
            detail=stream.detail,
            type=stream.type,
            count=len(all_stamps) - (self._playback.unusable[index] if first_ns is None else 0),
            first_stamp_ns=min(stamps) if stamps else None,
            last_stamp_ns=max(stamps) if stamps else None,
            frame=", ".join(list(stream.frames)[:8]),
            out_of_order=ordering.out_of_order_stamps(stamps) if stamps else 0,
            used=index in self._selection.kind_of,
        )

    def _account(self) -> MessageCounts:
        total = MessageCounts()
        for part in (self._opening, self._source.message_counts, self._playback):
            total.absorb(part, self._concerned)
        total.absorb(self._truth)
        return total


def _unusable_truth(event: Event | Skip, pose: Odometry | None) -> SkipReason | None:
    """The reason why a message is not a true pose; None if it is one."""
    if pose is None:
        return event.reason if isinstance(event, Skip) else SkipReason.UNDECODABLE
    is_far = max(abs(pose.x_m), abs(pose.y_m)) > MAX_COORDINATE_M
    return unusable_reason(pose) or (SkipReason.TOO_FAR if is_far else None)
