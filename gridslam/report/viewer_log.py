"""result.mcap: a run for Foxglove, Lichtblick and other viewers of ROS 2 logs."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Odometry, Range, Transform, readonly
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.trajectory import Trajectory
from gridslam.logs.config import LogConfig
from gridslam.logs.convert import topic_of
from gridslam.logs.encoding.cdr import CdrWriter
from gridslam.logs.encoding.encoded import Encoded
from gridslam.logs.kinds import TRUTH_TOPIC
from gridslam.logs.log import Log
from gridslam.logs.mcap.writer import McapWriter
from gridslam.logs.open import open_log
from gridslam.logs.ros.encode import encode
from gridslam.methods import registry
from gridslam.methods.base import PlacedObject
from gridslam.report.viewer_messages import CUBE, MAP_FRAME, TEXT, marker, occupancy_grid, path, pose_array
from gridslam.runs.run import Run

MAX_PATH_POSES = 10_000
OBJECT_SIZE_M, TEXT_SIZE_M = 0.4, 0.25
STATIC_COLOUR, MOVED_COLOUR = (0.2, 0.5, 0.9, 0.8), (0.9, 0.5, 0.1, 0.8)


def write_viewer_log(file: Path, run: Run, log_path: Path) -> None:
    """Write map, path and objects first, then the transforms, the log's own data and the particles in time order.

    What the method reads is read again from the log at `log_path`, one event at a time. The same run gives the same bytes.
    """
    kinds = registry.METHODS[run.config.method_name].reads
    odometry = _Odometry.of(log_path, run.config.log) if "odom" in kinds else None
    with (
        open_log(log_path, run.config.log, kinds) as log,
        McapWriter(file) as writer,
    ):
        for message in _messages(run, log, odometry):
            writer.append(message)


def _messages(run: Run, log: Log, odometry: _Odometry | None) -> Iterator[Encoded]:
    trajectory = run.result.trajectory
    start = int(trajectory.stamps_ns.min()) if len(trajectory) else 0
    yield from _latched(run, log, start)
    transforms = [_transforms(trajectory, MAP_FRAME, log.base_frame)]
    if odometry is not None:
        corrections = corrections_of(trajectory, odometry.path)
        transforms = [
            _transforms(corrections, MAP_FRAME, odometry.frame_id),
            _transforms(odometry.path, odometry.frame_id, log.base_frame),
        ]
    # Recorded order may have out-of-order stamps; a viewer sorts by stamp.
    yield from heapq.merge(
        *transforms,
        _recorded(log),
        (pose_array("/particles", s.stamp_ns, s.particles) for s in run.particles),
        key=lambda message: message.stamp_ns,
    )


@dataclass(frozen=True, slots=True)
class _Odometry:
    """The odometry's frame, and its path sorted by stamp."""

    frame_id: str
    path: Trajectory

    @staticmethod
    def of(log_path: Path, config: LogConfig) -> _Odometry | None:
        """The odometry of a log; None without any, or if its frame is that of the map."""
        with open_log(log_path, config, ("odom",)) as log:
            found = [event for event in log.events() if isinstance(event, Odometry)]
        if not found or found[0].frame_id == MAP_FRAME:
            return None
        stamps = np.array([event.stamp_ns for event in found], np.int64)
        poses = np.array([(event.x_m, event.y_m, event.yaw_rad) for event in found])
        return _Odometry(found[0].frame_id or "odom", Trajectory(stamps, poses).sorted())


def corrections_of(trajectory: Trajectory, odometry: Trajectory) -> Trajectory:
    """T_map_odom at those stamps of a trajectory that lie within the time of the odometry."""
    path = trajectory.sorted()
    T_odom_base, inside = odometry.at(path.stamps_ns)
    T_map_odom = se2.compose(path.poses[inside], se2.inverse(T_odom_base[inside]))
    return Trajectory(path.stamps_ns[inside], np.asarray(T_map_odom).reshape(-1, 3))


def _latched(run: Run, log: Log, start_ns: int) -> Iterator[Encoded]:
    """Messages that are valid for the whole log, with the stamp `start_ns`."""
    for extrinsics in log.sensor_extrinsics:
        if extrinsics.frame_id != extrinsics.child_frame_id:
            yield from encode(_at(extrinsics, start_ns))
    if run.occupancy is not None and run.occupancy.probability.size:
        yield occupancy_grid("/map", start_ns, run.occupancy)
    for name, further in sorted(run.result.maps.items()):
        if further.probability.size:
            yield occupancy_grid(f"/{name}", start_ns, further)
    if len(run.result.trajectory):
        yield _path(run.result.trajectory, start_ns)
    if run.result.objects:
        yield object_markers(run.result.objects, start_ns)


def _at(extrinsics: Transform, stamp_ns: int) -> Transform:
    return Transform(
        stamp_ns,
        extrinsics.frame_id,
        child_frame_id=extrinsics.child_frame_id,
        translation_m=extrinsics.translation_m,
        quat_wxyz=extrinsics.quat_wxyz,
        is_static=True,
    )


def _path(trajectory: Trajectory, start_ns: int) -> Encoded:
    """The path, thinned to at most MAX_PATH_POSES and the last pose; /tf has all poses."""
    count = len(trajectory)
    kept = np.unique(np.r_[np.arange(0, count, -(-count // MAX_PATH_POSES)), count - 1])
    return path("/path", start_ns, trajectory.stamps_ns[kept], trajectory.poses[kept])


def _transforms(poses: Trajectory, parent: str, child: str) -> Iterator[Encoded]:
    """T_parent_child at every stamp."""
    for stamp, (x, y, yaw) in zip(poses.stamps_ns.tolist(), poses.poses.tolist(), strict=True):
        w, qx, qy, qz = quaternion_of_yaw(yaw).tolist()
        yield from encode(Transform(stamp, parent, child, (x, y, 0.0), (w, qx, qy, qz)))


def _recorded(log: Log) -> Iterator[Encoded]:
    """The log's own data, including true poses; each reading of a ranger on a servo is added as a scan of one beam."""
    for kind, topic, event in log.events_by_stream(with_truth=True):
        if isinstance(event, Transform) and event.is_static:
            continue
        if kind == "truth":
            yield from encode(event, TRUTH_TOPIC)
            continue
        yield from encode(event, topic_of(event, topic if topic.startswith("/") else None))
        if isinstance(event, Range):
            yield from encode(_one_beam(event), "/range_beams")


def _one_beam(reading: Range) -> LaserScan:
    ranges = readonly([reading.range_m], np.float32)
    limits = (reading.range_min_m, reading.range_max_m)
    return LaserScan(reading.stamp_ns, reading.frame_id, ranges, reading.bearing_rad, 0.0, *limits)


def object_markers(objects: Sequence[PlacedObject], stamp_ns: int) -> Encoded:
    """visualization_msgs/MarkerArray: a cube for each object, orange if it was moved, with its name above."""
    body = CdrWriter().uint32(2 * len(objects))
    for number, placed in enumerate(objects):
        x, y, yaw = placed.pose.tolist()
        marker(
            body,
            stamp_ns,
            space="objects",
            number=number,
            kind=CUBE,
            at=(x, y, OBJECT_SIZE_M / 2, yaw),
            size=(OBJECT_SIZE_M,) * 3,
            colour=MOVED_COLOUR if placed.has_moved else STATIC_COLOUR,
        )
        marker(
            body,
            stamp_ns,
            space="names",
            number=number,
            kind=TEXT,
            at=(x, y, 2 * OBJECT_SIZE_M, 0.0),
            size=(0.0, 0.0, TEXT_SIZE_M),
            colour=(0.0, 0.0, 0.0, 1.0),
            text=" ".join(word for word in (placed.name, placed.state) if word),
        )
    return Encoded("/objects", "visualization_msgs/msg/MarkerArray", stamp_ns, body.data())
