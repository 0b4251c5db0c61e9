"""Poses on a topic of a log, or between two frames of its tf tree."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError, InputError
from gridslam.core.messages import Transform
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.evaluation.readers.trajectory_formats import is_pose_line
from gridslam.logs.codecs.transform import unusable_reason
from gridslam.logs.config import LogConfig
from gridslam.logs.log import Log
from gridslam.logs.open import open_log
from gridslam.logs.tum import lines_of

ARROW = "->"
Edge = tuple[str, str]  # parent, child


def read_topic(path: Path, topic: str, option: str = "--truth-topic") -> PoseSeries:
    """The poses of a topic (PoseStamped, PoseWithCovarianceStamped, Odometry), or of a pair of tf frames `map->base_link`.

    `option` names the topic's option in messages. Raises ConfigError: the log has no such topic or frames, and what it has.
    LogError: the log is unreadable. InputError: no pose can be used.
    """
    name = f"{path.name} {topic}"
    if is_trajectory_file(path):
        raise ConfigError(
            f"{option} {topic}: {path} is a trajectory file, which has no topics; leave the option out"
        )
    if ARROW in topic:
        parent, _, child = (part.strip() for part in topic.partition(ARROW))
        trajectory = _tf_poses(path, parent, child, option)
    else:
        try:
            with open_log(path, LogConfig(truth=topic), ()) as log:
                found = log.truth()
        except ConfigError as error:
            raise ConfigError(str(error).replace("log.truth:", f"{option}: {path}:", 1)) from None
        trajectory = found if found is not None else Trajectory.empty()
    if not len(trajectory):
        raise InputError(f"{path}: no usable pose on {topic}")
    return PoseSeries.of(name, trajectory)


def is_trajectory_file(path: Path) -> bool:
    """Whether a file's first line is a pose of one of the formats of trajectories."""
    try:
        first = next(iter(lines_of(path, "")), None)
    except InputError:  # no text
        return False
    return first is not None and is_pose_line(first[1])


def _tf_poses(path: Path, parent: str, child: str, option: str) -> Trajectory:
    """T_parent_child along the tf tree, at the stamps of the moving edge nearest to the child."""
    with open_log(path, LogConfig(), ("tf",)) as log:
        edges, static = _edges(log)
    chain = _chain({**dict.fromkeys(static), **dict.fromkeys(edges)}, parent, child)
    if chain is None:
        pairs = ", ".join(sorted(f"{a}{ARROW}{b}" for a, b in {*edges, *static})) or "no transforms"
        raise ConfigError(
            f"{option} {parent}{ARROW}{child}: {path} has no such chain of frames; it has {pairs}"
        )
    moving = [edge for edge in chain if edge in edges]
    if not moving:
        raise ConfigError(
            f"{option} {parent}{ARROW}{child}: {path}: the frames do not move against each other"
        )
    stamps = edges[moving[-1]].stamps_ns
    for edge in moving:
        track = edges[edge].stamps_ns
        stamps = stamps[(stamps >= track[0]) & (stamps <= track[-1])]
    poses: NDArray[np.float64] = np.zeros((len(stamps), 3))
    for edge in chain:
        step = edges[edge].at(stamps)[0] if edge in edges else static[edge]
        poses = se2.compose(poses, np.broadcast_to(step, poses.shape))
    return Trajectory(stamps, poses)


def _edges(log: Log) -> tuple[dict[Edge, Trajectory], dict[Edge, NDArray[np.float64]]]:
    """The moving transforms of a log by parent and child, sorted by stamp, and the static ones."""
    stamps: dict[Edge, list[int]] = {}
    poses: dict[Edge, list[NDArray[np.float64]]] = {}
    usable = (t for t in log.static_transforms if unusable_reason(t) is None)
    static = {(t.frame_id, t.child_frame_id): _planar(t) for t in usable}
    for event in log.events():
        if isinstance(event, Transform):
            edge = (event.frame_id, event.child_frame_id)
            if event.is_static:
                static[edge] = _planar(event)
            else:
                stamps.setdefault(edge, []).append(event.stamp_ns)
                poses.setdefault(edge, []).append(_planar(event))
    moving = {
        edge: Trajectory(np.array(stamps[edge], np.int64), np.array(poses[edge])).sorted() for edge in stamps
    }
    return moving, static


def _planar(transform: Transform) -> NDArray[np.float64]:
    x, y, _ = transform.translation_m
    return np.array([x, y, float(se2.yaw_of_quaternion(np.array(transform.quat_wxyz)))])


def _chain(edges: Mapping[Edge, object], parent: str, child: str) -> list[Edge] | None:
    """The edges from parent down to child; None if child is not below parent."""
    parent_of = {c: p for p, c in edges}
    chain: list[Edge] = []
    frame = child
    while frame != parent:
        above = parent_of.get(frame)
        if above is None or len(chain) > len(parent_of):
            return None
        chain.append((above, frame))
        frame = above
    return chain[::-1] or None
