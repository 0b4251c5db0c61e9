"""result.mcap: a run for Foxglove, Lichtblick and other viewers of ROS 2 logs."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gridslam.core.messages import LaserScan, Range, Transform, readonly
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.trajectory import Trajectory
from gridslam.logs.log import Log
from gridslam.logs.mcap.writer import McapWriter
from gridslam.logs.open import open_log
from gridslam.logs.ros.cdr import CdrWriter
from gridslam.logs.ros.encode import encode
from gridslam.logs.ros.encoded import Encoded
from gridslam.methods import registry
from gridslam.methods.base import PlacedObject
from gridslam.report.viewer_messages import CUBE, MAP_FRAME, TEXT, marker, occupancy_grid, path, pose_array
from gridslam.runs.run import Run

SHOWN = frozenset(
    {"scan", "range", "odom"}
)  # odom names the base frame; images are not needed and are not decoded
MAX_PATH_POSES = 10_000
OBJECT_SIZE_M, TEXT_SIZE_M = 0.4, 0.25
STATIC_COLOUR, MOVED_COLOUR = (0.2, 0.5, 0.9, 0.8), (0.9, 0.5, 0.1, 0.8)


def write_viewer_log(file: Path, run: Run, log_path: Path) -> None:
    """Write map, path and objects first, then map -> base, scans and particles in time order.

    The scans are read again from the log at `log_path`, one at a time. Scans outside the time of the trajectory have no pose
    and are left out. The same run gives the same bytes.
    """
    kinds = [kind for kind in registry.METHODS[run.config.method_name].reads if kind in SHOWN]
    with (
        open_log(log_path, run.config.log, kinds) as log,
        McapWriter(file) as writer,
    ):
        for message in _messages(run, log):
            writer.append(message)


def _messages(run: Run, log: Log) -> Iterator[Encoded]:
    trajectory = run.result.trajectory
    start = int(trajectory.stamps_ns.min()) if len(trajectory) else 0
    yield from _latched(run, log, start)
    # Recorded order may have out-of-order stamps; a viewer sorts by stamp.
    yield from heapq.merge(
        _transforms(trajectory, log.base_frame),
        _scans(log, trajectory),
        (pose_array("/particles", s.stamp_ns, s.particles) for s in run.particles),
        key=lambda message: message.stamp_ns,
    )


def _latched(run: Run, log: Log, start_ns: int) -> Iterator[Encoded]:
    """Messages that are valid all the time, with the first stamp."""
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


def _transforms(trajectory: Trajectory, base_frame: str) -> Iterator[Encoded]:
    """T_map_base of every pose."""
    for stamp, (x, y, yaw) in zip(trajectory.stamps_ns.tolist(), trajectory.poses.tolist(), strict=True):
        w, qx, qy, qz = quaternion_of_yaw(yaw).tolist()
        yield from encode(Transform(stamp, MAP_FRAME, base_frame, (x, y, 0.0), (w, qx, qy, qz)))


def _scans(log: Log, trajectory: Trajectory) -> Iterator[Encoded]:
    """Scans in the frames of their sensors; a reading of a ranger on a servo becomes a scan of one beam."""
    if not len(trajectory):
        return
    first, last = int(trajectory.stamps_ns.min()), int(trajectory.stamps_ns.max())
    for topic, event in log.events_by_topic():
        if not first <= event.stamp_ns <= last:
            continue
        named = topic if topic.startswith("/") else None
        if isinstance(event, LaserScan):
            yield from encode(event, named or "/scan")
        elif isinstance(event, Range):
            yield from encode(_one_beam(event), named or "/range")


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
