"""Computes one T_base_sensor per sensor frame, from static transforms and the config."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Transform
from gridslam.logs import rotations
from gridslam.logs.codecs import transform
from gridslam.logs.config import ExtrinsicsConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.rotations import Rigid

# Largest tilt of the axis of a planar lidar: beyond 60 degrees its scans are not sections of a floor plan
MAX_TILT_COS = 0.5
# Largest number of frames from a sensor to the root of its tree; arms with tools have some 20
MAX_DEPTH = 100
MAX_LISTED = 4  # largest number of contradicting extrinsics that a message lists

Tree = Mapping[str, tuple[str, Rigid]]  # child -> parent, T_parent_child


def usable(edges: Iterable[Transform], message_counts: MessageCounts) -> list[Transform]:
    """The transforms that are usable rigid motions; the others are counted."""
    found = []
    for edge in edges:
        reason = transform.unusable_reason(edge)
        if reason is None:
            found.append(edge)
            norm = math.sqrt(sum(c * c for c in edge.quat_wxyz))
            if abs(norm - 1.0) > rotations.MAX_NORM_ERROR:
                message_counts.find(
                    f"the rotation of {edge.frame_id}->{edge.child_frame_id} has length {norm:.3g}, not 1: its direction is used"
                )
        else:
            message_counts.skip("tf", reason.value, f"the transform {edge.frame_id}->{edge.child_frame_id}")
    return found


def tree_of(edges: Iterable[Transform]) -> dict[str, tuple[str, Rigid]]:
    """The tree of frames; of two transforms to one child the later one is used."""
    tree: dict[str, tuple[str, Rigid]] = {}
    for edge in edges:
        quaternion = rotations.normalise(edge.quat_wxyz)
        if quaternion is not None:
            tree[edge.child_frame_id] = (edge.frame_id, (edge.translation_m, quaternion))
    return tree


def refuse_several_places(
    edges: Collection[Transform], frames: Iterable[str], base_frame: str, config: Collection[str]
) -> None:
    """Raises ConfigError: transforms contradict each other about the pose of one of the `frames` on the robot.

    Frames with extrinsics in the config are not checked.
    """
    tree = tree_of(edges)
    edges_to: dict[str, list[Transform]] = {}
    for edge in edges:
        edges_to.setdefault(edge.child_frame_id, []).append(edge)
    checked = {base_frame}
    for frame in (frame for frame in frames if frame not in config):
        for child in ancestors(tree, frame):
            if child in checked:  # and so is all above it
                break
            checked.add(child)
            places = _distinct_places(edges_to.get(child, ()), MAX_LISTED)
            if len(places) > 1:
                listing = "; ".join(f"on {edge.frame_id} {_in_words(edge)}" for edge in places)
                raise ConfigError(
                    f"log.extrinsics.{frame}: the transforms of {child} contradict each other: {listing}. Give the place of "
                    f"{frame}: log: {{extrinsics: {{{frame}: {{x: 0.0, y: 0.0, yaw: 0.0}}}}}}"
                )


def _distinct_places(edges: Iterable[Transform], count: int) -> list[Transform]:
    """The first `count` transforms to one child frame whose parent or pose differs from all earlier ones."""
    found: list[Transform] = []
    for edge in edges:
        if len(found) == count:
            break
        is_known = any(
            edge.frame_id == other.frame_id and rotations.is_same(_pose_of(edge), _pose_of(other))
            for other in found
        )
        if not is_known:
            found.append(edge)
    return found


def _pose_of(edge: Transform) -> Rigid:
    return edge.translation_m, rotations.normalise(edge.quat_wxyz) or rotations.IDENTITY[1]


def _in_words(edge: Transform) -> str:
    x, y, _ = edge.translation_m
    return f"x {x:.3g} y {y:.3g} yaw {rotations.yaw_of(_pose_of(edge)[1]):.3g}"


def ancestors(tree: Tree, frame: str) -> dict[str, Rigid]:
    """The frame and its ancestors, with T_ancestor_frame. The list ends where a cycle closes, and at MAX_DEPTH."""
    found = {frame: rotations.IDENTITY}
    above = rotations.IDENTITY
    while frame in tree and len(found) <= MAX_DEPTH:
        frame, step = tree[frame]
        if frame in found:
            break
        above = rotations.compose(step, above)
        found[frame] = above
    return found


def sensor_transforms(
    sensor_frames: Iterable[str],
    edges: Iterable[Transform],
    config: Mapping[str, ExtrinsicsConfig],
    base_frame: str,
    stamp_ns: int,
    message_counts: MessageCounts,
    on_robot: Collection[str] = (),
) -> list[Transform]:
    """One static transform per frame in `sensor_frames`, by `config` or by the `edges` of the log's tree at `stamp_ns`.

    It is T_base_sensor where the frame is connected with `base_frame`, else T_root_sensor of the sensor's own tree (a camera on
    the wall), else the identity, with a note in `message_counts`. Frames in `on_robot` are never on the wall.
    """
    tree = tree_of(edges)
    base_ancestors = ancestors(tree, base_frame)
    found = []
    for frame in dict.fromkeys(sensor_frames):
        parent, pose = base_frame, rotations.IDENTITY
        if frame in config:
            m = config[frame]
            pose = ((m.x, m.y, m.z), rotations.from_euler(m.roll, m.pitch, m.yaw))
        elif frame != base_frame:
            above = ancestors(tree, frame)
            common = next((name for name in above if name in base_ancestors), None)
            if common is not None:
                pose = rotations.compose(rotations.inverse(base_ancestors[common]), above[common])
            elif len(above) > 1 and frame not in on_robot:
                parent, pose = list(above.items())[-1]
            else:
                gap = f" (its tree ends at {list(above)[-1]})" if len(above) > 1 else ""
                message_counts.find(
                    f"no transform from {base_frame} to {frame}{gap}: taken as mounted at the robot's centre, "
                    f"facing forward; if it is not, set log.extrinsics.{frame} with x, y, yaw"
                )
        found.append(Transform(stamp_ns, parent, frame, pose[0], pose[1], is_static=True))
    return found


def refuse_upright(transforms: Iterable[Transform]) -> None:
    """Raises ConfigError: a planar lidar scans an upright plane, as in the optical frame of a camera."""
    for sensor in transforms:
        _, x, y, _ = rotations.normalise(sensor.quat_wxyz) or rotations.IDENTITY[1]
        if abs(1.0 - 2.0 * (x * x + y * y)) < MAX_TILT_COS:
            raise ConfigError(
                f"log.extrinsics.{sensor.child_frame_id}: by tf this lidar scans an upright plane, as in the optical frame of "
                "a camera; a map needs a level one. Give its true pose: log: {extrinsics: "
                f"{{{sensor.child_frame_id}: {{x: 0.0, y: 0.0, yaw: 0.0}}}}}}"
            )
