"""An open log: its streams, its events in order, its truth, and counts of what was lost."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType

import numpy as np

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.core.stamps import END_NS, NS_PER_S
from gridslam.core.trajectory import Trajectory
from gridslam.logs import extrinsics, ordering
from gridslam.logs.clock_steps import clock_epochs
from gridslam.logs.clocks import check_overlap, restamp
from gridslam.logs.config import LogConfig
from gridslam.logs.kinds import KINDS, fault_of
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.moving_mount import MovingMount, moving_mounts
from gridslam.logs.playback import events_of, file_states, true_pose_of
from gridslam.logs.repeats import is_looped, without_repeats
from gridslam.logs.selection import select_streams
from gridslam.logs.several_sensors import note_choice, refuse_unknown_places
from gridslam.logs.skips import Skip, SkipReason
from gridslam.logs.streams import RecordedStream, Source, StreamInfo
from gridslam.logs.tum import LARGEST_M, read_trajectory
from gridslam.logs.virtual_scan import VirtualLidar, virtual_lidar


class Log:
    """An open log; use it as a context manager. `path` is the opened path, `format` the recognised format."""

    def __init__(self, path: Path, source: Source, config: LogConfig, kinds: Collection[str] | None) -> None:
        self.path = path
        self.format = source.format
        self.compression = source.compression
        self._source = source
        self._config = config
        self._selection = select_streams(source.streams, config, kinds, source.base_frame)
        # What is wrong with streams that nobody asked for is no loss; tf matters to all.
        self._concerned = None if kinds is None else {*kinds, "tf", "unknown"}
        self._for_a_method = kinds is not None  # a conversion keeps what was recorded
        self._playback = MessageCounts()
        self._opening = MessageCounts()
        self._truth = MessageCounts()
        self._lidars: dict[str, VirtualLidar] = {}
        self._moving: dict[str, MovingMount] = {}
        self._restamped: frozenset[int] = frozenset()
        if self._for_a_method:
            self._restamped = restamp(source.streams, self._selection.kind_of, self._opening)
            check_overlap(source.streams, self._selection.kind_of, self._opening)
        self._static = self._with_virtual_lidars(self._mount())
        self._file_states = file_states(source.files)
        self._note_disorder()
        if self._for_a_method:
            note_choice(source.streams, self._selection.kind_of, config, self._opening)

    def __enter__(self) -> Log:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close open files, and free what is kept of their messages."""
        self._source.close()

    @property
    def streams(self) -> list[StreamInfo]:
        """All streams of the log, by kind, then by topic."""
        return [self._info(index) for index in self._selection.listed]

    @property
    def base_frame(self) -> str:
        """The robot's frame, which odometry moves and sensors are mounted on."""
        return self._selection.base_frame

    @property
    def sensor_extrinsics(self) -> list[Transform]:
        """The static transforms with which `events()` begins: one per sensor frame in use."""
        return list(self._static)

    @property
    def static_transforms(self) -> list[Transform]:
        """All static transforms of the log."""
        return list(self._source.static_edges)

    @property
    def start_ns(self) -> int:
        """The first stamp of the log, from which `--start` and `--end` count."""
        stamps = [info.first_stamp_ns for info in self.streams if info.first_stamp_ns is not None]
        return min(stamps, default=0)

    def _span_ns(self) -> tuple[int, int]:
        """The stamps of the part that is used. Raises ConfigError: the log ends before it."""
        start_s, end_s = self._config.start_s, self._config.end_s
        if start_s is None and end_s is None:
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
        return len(self._static) + sum(
            len(self._source.streams[i].stamps_ns) for i in self._selection.kind_of
        )

    @property
    def counters(self) -> dict[str, int]:
        """`read.<kind>`, `skipped.<kind>.<reason>`, `lost.<what>`, `out_of_order.<kind>`, `equal_stamps.<kind>`,
        `unused.<kind>`. What concerns events is that of the present or last pass of `events()`.
        """
        return dict(sorted(self._account().counters.items()))

    @property
    def problems(self) -> list[str]:
        """Lines for people: what was lost, where it was lost first, and what was assumed."""
        return self._account().problems

    @property
    def is_lossy(self) -> bool:
        """Whether something in the log could not be used."""
        return self._account().is_lossy

    def input_hashes(self) -> dict[str, str]:
        """SHA-256 of each file of the log, by its name inside the log."""
        root = self.path if self.path.is_dir() else self.path.parent
        hashes = {}
        for file in self._source.files:
            digest = hashlib.sha256()
            with file.open("rb") as stream:
                while block := stream.read(1 << 20):
                    digest.update(block)
            name = file.relative_to(root) if file.is_relative_to(root) else file
            hashes[str(name)] = digest.hexdigest()
        return dict(sorted(hashes.items()))

    def events(self) -> Iterator[Event]:
        """Static transforms, then all used streams merged by stamp; each call starts at the beginning."""
        for _, event in self.events_by_topic():
            yield event

    def events_by_topic(self) -> Iterator[tuple[str, Event]]:
        """As `events`, each with the topic of its stream (static transforms: `/tf_static`)."""
        for _, topic, event in self.events_by_stream():
            yield topic, event

    def events_by_stream(self, with_truth: bool = False) -> Iterator[tuple[str, str, Event]]:
        """As `events`, each with the kind and the topic of its stream (static transforms: `tf`, `/tf_static`).

        `with_truth` adds the true poses, of kind `truth`, for writing the log anew.
        """
        self._playback = message_counts = MessageCounts()
        for transform in self._static:
            message_counts.counters["read.extrinsics"] += 1
            yield "tf", "/tf_static", transform
        kind_of = dict(self._selection.kind_of)
        if with_truth and self._selection.truth is not None:
            kind_of[self._selection.truth] = "truth"
        limit_bytes = self._config.limits.reorder_mb << 20
        items = events_of(
            self.path,
            self._source,
            kind_of,
            by_stamp=self._is_sorted,
            limit_bytes=limit_bytes,
            message_counts=message_counts,
            states=self._file_states,
            lidars=self._lidars,
            with_repairs=self._for_a_method,
            restamped=self._restamped,
            span_ns=self._span_ns(),
            sweep_s=self._config.sweep_s,
        )
        if self._for_a_method and is_looped(self._source.streams, self._selection.kind_of):
            items = without_repeats(items, message_counts)
        for kind, topic, event in items:
            if isinstance(event, LaserScan) and (moving := self._moving.get(event.frame_id)):
                transform, event = moving.placed(event)
                yield "tf", "/tf", transform
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
            fault = _fault_of_truth(event, pose)
            if pose is not None and fault is None:
                stamps.append(pose.stamp_ns)
                poses.append((pose.x_m, pose.y_m, pose.yaw_rad))
            elif fault is not None:
                message_counts.count(f"skipped.truth.{fault.value}")
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

    def _info(self, index: int) -> StreamInfo:
        stream = self._source.streams[index]
        stamps = stream.stamps_ns if stream.kind != "other" else None
        is_truth = index == self._selection.truth
        return StreamInfo(
            kind="truth" if is_truth else self._selection.kind_of.get(index, stream.kind),
            topic=stream.topic,
            detail=stream.detail,
            type=stream.type,
            count=len(stream.stamps_ns),
            first_stamp_ns=min(stamps) if stamps else None,
            last_stamp_ns=max(stamps) if stamps else None,
            frame=", ".join(list(stream.frames)[:8]),
            out_of_order=ordering.out_of_order_stamps(stamps) if stamps else 0,
            used=index in self._selection.kind_of,
        )

    def _mount(self) -> list[Transform]:
        streams = self._source.streams
        used = [streams[i] for i, kind in self._selection.kind_of.items() if KINDS[kind].is_sensor]
        base = self._selection.base_frame
        needed = [f for s in used if s.kind != "imu" for f in s.frames]
        edges = [
            Transform(0, next(iter(s.frames)), s.child_frame, s.constant[0], s.constant[1])
            for s in streams
            if s.constant is not None and s.child_frame != base
        ]
        edges = extrinsics.usable([*edges, *self._source.static_edges], self._opening)
        tree = extrinsics.tree_of(edges)
        lidar_frames = [
            frame
            for i, kind in self._selection.kind_of.items()
            if kind == "scan" and self._for_a_method
            for frame in streams[i].frames
        ]
        in_place = [f for f in lidar_frames if f not in self._config.extrinsics]
        self._moving = moving_mounts(self._source, in_place, tree, base)
        for frame in self._moving:
            self._opening.note(
                f"{frame} sits on a joint that moves: each scan is placed by its angle at the scan's stamp"
            )
        self._refuse_unknown_frames(tree)
        needed += [
            f for s in used if s.kind == "imu" for f in s.frames if f in tree or f in self._config.extrinsics
        ]
        first = min(
            (min(streams[i].stamps_ns) for i in self._selection.kind_of if streams[i].stamps_ns), default=0
        )
        mounted = extrinsics.mount(
            [frame for frame in dict.fromkeys(needed) if frame not in self._moving],
            edges,
            config=self._config.extrinsics,
            base_frame=base,
            stamp_ns=first,
            message_counts=self._opening,
            on_robot=lidar_frames,
        )
        fixed = [frame for frame in in_place if frame not in self._moving]
        refuse_unknown_places(streams, self._selection, fixed, tree)
        extrinsics.refuse_upright(
            [m for m in mounted if m.child_frame_id in self._planar_lidars(lidar_frames)]
        )
        return mounted

    def _planar_lidars(self, frames: list[str]) -> set[str]:
        """Those of the frames in which planar lidars measure, no others."""
        clouds = {f for s in self._source.streams if s.kind == "cloud" for f in s.frames}
        return set(frames) - clouds - self._config.extrinsics.keys()

    def _refuse_unknown_frames(self, tree: extrinsics.Tree) -> None:
        """Raises ConfigError: the config gives extrinsics of a frame that the log does not have."""
        frames = {frame for stream in self._source.streams for frame in stream.frames}
        known = frames | tree.keys() | {parent for parent, _ in tree.values()}
        for frame in self._config.extrinsics:
            if frame not in known:
                sensors = {f for s in self._source.streams if KINDS[s.kind].is_sensor for f in s.frames}
                has = ", ".join(sorted(sensors or frames)[:8]) or "none"
                raise ConfigError(
                    f"log.extrinsics.{frame}: the log has no such frame; its sensor frames are: {has}"
                )

    def _with_virtual_lidars(self, mounted: list[Transform]) -> list[Transform]:
        """The extrinsics, and those of the virtual lidars of clouds that serve as scans."""
        frames = {
            frame
            for i, kind in self._selection.kind_of.items()
            if kind == "scan" and self._source.streams[i].kind == "cloud"
            for frame in self._source.streams[i].frames
        }
        added = []
        for transform in mounted:
            if transform.child_frame_id in frames and transform.frame_id == self.base_frame:
                lidar = virtual_lidar(transform.child_frame_id, transform, self._config.cloud)
                self._lidars[transform.child_frame_id] = lidar
                added.append(lidar.extrinsics(self.base_frame, transform.stamp_ns))
                self._opening.note(
                    f"point clouds of {transform.child_frame_id} serve as scans: returns from "
                    f"{lidar.min_height_m:.2f} to {lidar.max_height_m:.2f} m in {self.base_frame}; "
                    "log.cloud sets the band"
                )
        return [*mounted, *added]

    def _note_clock_jumps(self) -> None:
        streams = self._source.streams
        epochs = clock_epochs(
            [ordering.without_outliers(streams[i].stamps_ns) for i in self._selection.kind_of]
        )
        if jumps := max((int(e[-1]) for e in epochs if len(e)), default=0):
            self._opening.count("clock_jumps", jumps)
            self._opening.note(
                f"the clock was set back {jumps} times, or the recording played in a loop: streams stay together in "
                "recorded order"
            )

    def _note_disorder(self) -> None:
        if not self._is_sorted:
            self._note_clock_jumps()
        for index, kind in self._selection.kind_of.items():
            stamps = self._source.streams[index].stamps_ns
            if count := ordering.out_of_order_stamps(stamps):
                self._opening.count(f"out_of_order.{kind}", count)
                self._opening.note(_disorder_note(self._source.streams[index], count, self._is_sorted))
            if equal := ordering.repeated_stamps(stamps):
                self._opening.count(f"equal_stamps.{kind}", equal)
        for index in self._selection.listed:
            stream = self._source.streams[index]
            if (
                index in self._selection.kind_of
                or index == self._selection.truth
                or not KINDS[stream.kind].is_event
            ):
                continue
            if stream.stamps_ns:
                self._opening.count(f"unused.{stream.kind}", len(stream.stamps_ns))

    def _account(self) -> MessageCounts:
        total = MessageCounts()
        for part in (self._opening, self._source.message_counts, self._playback):
            total.absorb(part, self._concerned)
        total.absorb(self._truth)
        return total


def _fault_of_truth(event: Event | Skip, pose: Odometry | None) -> SkipReason | None:
    """The reason why a message is no true pose; None where it is one."""
    if pose is None:
        return event.reason if isinstance(event, Skip) else SkipReason.UNDECODABLE
    is_far = max(abs(pose.x_m), abs(pose.y_m)) > LARGEST_M
    return fault_of(pose) or (SkipReason.TOO_FAR if is_far else None)


def _disorder_note(stream: RecordedStream, count: int, is_sorted: bool) -> str:
    what = "are sorted" if is_sorted else "keep their recorded place; log.order: stamp would sort them"
    return f"{stream.label}: {count} out-of-order stamps; the messages {what}"
