"""Extrinsics of the sensors of a log: fixed ones, those on moving joints, and virtual lidars made of point clouds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Transform
from gridslam.logs.config import LogConfig
from gridslam.logs.kinds import KINDS
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.placement import extrinsics
from gridslam.logs.placement.levelling import LevelBand, Tilt, find_tilt, fixed_tilt_rad
from gridslam.logs.placement.moving_extrinsics import MovingExtrinsics, moving_extrinsics
from gridslam.logs.placement.several_sensors import refuse_unknown_places
from gridslam.logs.placement.virtual_scan import VirtualLidar, virtual_lidar
from gridslam.logs.rotations import Rigid
from gridslam.logs.selection import StreamSelection
from gridslam.logs.streams import RecordedStream, Source

# Names of frames that do not move with the robot
WORLD_FRAMES = frozenset({"map", "odom", "world", "camera_init"})


@dataclass(frozen=True, slots=True)
class SensorPlacement:
    """Extrinsics of the sensor frames in use.

    `fixed` are static transforms, one per frame. By frame: `moving` are sensors on joints, `virtual_lidars` those made of clouds,
    `tilted` T_base_sensor of planar lidars that are mounted with a tilt, and see floor or ceiling.
    """

    fixed: Sequence[Transform]
    moving: Mapping[str, MovingExtrinsics]
    virtual_lidars: Mapping[str, VirtualLidar]
    tilted: Mapping[str, Rigid]


def place_sensors(
    source: Source,
    selection: StreamSelection,
    config: LogConfig,
    for_a_method: bool,
    message_counts: MessageCounts,
) -> SensorPlacement:
    """Place the sensors of the selected streams; what was assumed is noted. Lidars on joints are placed for methods alone.

    Raises ConfigError: the config names an unknown frame, a lidar's place is unknown among several, or a planar lidar is
    upright.
    """
    streams, base = source.streams, selection.base_frame
    edges = extrinsics.usable([*_constant_poses(streams, base), *source.static_edges], message_counts)
    tree = extrinsics.tree_of(edges)
    lidar_frames = _lidar_frames(streams, selection) if for_a_method else []
    in_place = [frame for frame in lidar_frames if frame not in config.extrinsics]
    moving = moving_extrinsics(source, in_place, tree, base)
    for frame in moving:
        message_counts.note(
            f"{frame} sits on a joint that moves: each scan is placed by its angle at the scan's stamp"
        )
    _refuse_unknown_frames(streams, tree, config)
    extrinsics.refuse_several_places(edges, lidar_frames, base, config.extrinsics)
    if for_a_method:  # a conversion keeps what was recorded
        _refuse_registered(streams, selection, config)
        _refuse_unknown_base(streams, tree, config)
    needed = _frames_in_use(streams, selection, tree, config)
    of_lidars = frozenset(lidar_frames)
    fixed = extrinsics.sensor_transforms(
        [frame for frame in dict.fromkeys(needed) if frame not in moving],
        edges,
        config=config.extrinsics,
        base_frame=base,
        stamp_ns=_first_stamp_ns(streams, selection),
        message_counts=message_counts,
        on_robot=of_lidars,
    )
    refuse_unknown_places(streams, selection, [f for f in in_place if f not in moving], tree)
    planar = _planar_lidars(streams, lidar_frames, config)
    extrinsics.refuse_upright([place for place in fixed if place.child_frame_id in planar])
    tilt = find_tilt(source, selection, config, tree, message_counts) if lidar_frames else None
    virtual = _virtual_lidars(streams, selection, fixed, config, tilt)
    on_base = [place for place in fixed if place.child_frame_id in of_lidars and place.frame_id == base]
    if tilt is not None:
        moving = _levelled(moving, on_base, virtual, tilt)
    for lidar_frame, lidar in virtual.items():
        message_counts.note(
            f"point clouds of {lidar_frame} serve as scans: returns from "
            f"{lidar.min_height_m:.2f} to {lidar.max_height_m:.2f} m in {base}; log.cloud sets the band"
        )
    stamps = {place.child_frame_id: place.stamp_ns for place in fixed}
    added = [lidar.extrinsics(base, stamps[frame]) for frame, lidar in virtual.items()]
    level_or_moving = {*virtual, *moving}
    tilted = _tilted([p for p in on_base if p.child_frame_id not in level_or_moving], message_counts)
    return SensorPlacement([*fixed, *added], moving, virtual, tilted)


def _tilted(places: Sequence[Transform], message_counts: MessageCounts) -> dict[str, Rigid]:
    """T_base_sensor of the planar lidars among the places that are mounted with a tilt, which is noted."""
    found = {}
    for place in places:
        pose = _pose_of(place)
        tilt_rad = fixed_tilt_rad(pose)
        if tilt_rad:
            found[place.child_frame_id] = pose
            band = LevelBand.of_lidar(pose[0][2])
            message_counts.note(
                f"{place.child_frame_id} is mounted with a tilt of {math.degrees(tilt_rad):.1f} deg: beams that end below "
                f"{band.min_m:.2f} or above {band.max_m:.2f} m in {place.frame_id} are left out"
            )
    return found


def _levelled(
    moving: Mapping[str, MovingExtrinsics],
    fixed: Sequence[Transform],
    virtual: Mapping[str, VirtualLidar],
    tilt: Tilt,
) -> dict[str, MovingExtrinsics]:
    """The extrinsics of lidars on joints, of `fixed` ones, and of those made of clouds, all on a robot that tilts."""
    places = {place.child_frame_id: MovingExtrinsics(place.frame_id, [_pose_of(place)]) for place in fixed}
    for frame, lidar in virtual.items():
        place = _pose_of(lidar.extrinsics(places[frame].base_frame, 0))
        places[lidar.frame_id] = MovingExtrinsics(places.pop(frame).base_frame, [place], is_upright=True)
    return {frame: replace(moved, tilt=tilt) for frame, moved in {**places, **moving}.items()}


def _pose_of(place: Transform) -> Rigid:
    return place.translation_m, place.quat_wxyz


def _constant_poses(streams: Sequence[RecordedStream], base: str) -> list[Transform]:
    """Moving transforms that never change, as edges: those of frames other than the robot's."""
    return [
        Transform(0, next(iter(s.frames)), s.child_frame, s.constant[0], s.constant[1])
        for s in streams
        if s.constant is not None and s.child_frame != base
    ]


def _lidar_frames(streams: Sequence[RecordedStream], selection: StreamSelection) -> list[str]:
    return [frame for i, kind in selection.kind_of.items() if kind == "scan" for frame in streams[i].frames]


def _frames_in_use(
    streams: Sequence[RecordedStream], selection: StreamSelection, tree: extrinsics.Tree, config: LogConfig
) -> list[str]:
    """Frames of the sensors that are read; frames of IMUs only if their extrinsics are known."""
    used = [streams[i] for i, kind in selection.kind_of.items() if KINDS[kind].is_sensor]
    frames = [frame for stream in used if stream.kind != "imu" for frame in stream.frames]
    of_imus = [frame for stream in used if stream.kind == "imu" for frame in stream.frames]
    return frames + [frame for frame in of_imus if frame in tree or frame in config.extrinsics]


def _first_stamp_ns(streams: Sequence[RecordedStream], selection: StreamSelection) -> int:
    return min((min(streams[i].stamps_ns) for i in selection.kind_of if streams[i].stamps_ns), default=0)


def _planar_lidars(
    streams: Sequence[RecordedStream], lidar_frames: Sequence[str], config: LogConfig
) -> set[str]:
    """Frames in which only planar lidars measure and for which the config has no extrinsics."""
    clouds = {frame for stream in streams if stream.kind == "cloud" for frame in stream.frames}
    return set(lidar_frames) - clouds - config.extrinsics.keys()


def _refuse_unknown_frames(
    streams: Sequence[RecordedStream], tree: extrinsics.Tree, config: LogConfig
) -> None:
    """Raises ConfigError: the config gives extrinsics of a frame that the log does not have."""
    frames = {frame for stream in streams for frame in stream.frames}
    known = frames | tree.keys() | {parent for parent, _ in tree.values()}
    for frame in config.extrinsics:
        if frame not in known:
            sensors = {f for s in streams if KINDS[s.kind].is_sensor for f in s.frames}
            has = ", ".join(sorted(sensors or frames)[:8]) or "none"
            raise ConfigError(
                f"log.extrinsics.{frame}: the log has no such frame; its sensor frames are: {has}"
            )


def _refuse_registered(
    streams: Sequence[RecordedStream], selection: StreamSelection, config: LogConfig
) -> None:
    """Raises ConfigError: clouds or scans are in a frame that does not move with the robot, registered by another program."""
    of_odometry = {f for i, kind in selection.kind_of.items() if kind == "odom" for f in streams[i].frames}
    fixed = WORLD_FRAMES | (of_odometry - {""})  # a message without a frame is no evidence
    for index, kind in selection.kind_of.items():
        stream = streams[index]
        still = [f for f in stream.frames if f in fixed and f not in config.extrinsics]
        if kind == "scan" and still and still[0] != selection.base_frame:
            raise ConfigError(
                f"log.topics.scan: {stream.label} is in {still[0]}, which does not move with the robot: another program put it "
                "there already. Record what the lidar itself sends, or name its topic: log: {topics: {scan: TOPIC}}"
            )


def _refuse_unknown_base(streams: Sequence[RecordedStream], tree: extrinsics.Tree, config: LogConfig) -> None:
    """Raises ConfigError: the config names a base frame that no transform and no odometry of the log has."""
    of_robots = {stream.child_frame for stream in streams} - {""}
    known = of_robots | tree.keys() | {parent for parent, _ in tree.values()}
    if config.base_frame is None or config.base_frame in known or not of_robots or config.extrinsics:
        return
    has = ", ".join(sorted(known)[:8])
    raise ConfigError(f"log.base_frame: the log has no frame {config.base_frame!r}; its frames are: {has}")


def _virtual_lidars(
    streams: Sequence[RecordedStream],
    selection: StreamSelection,
    fixed: Sequence[Transform],
    config: LogConfig,
    tilt: Tilt | None,
) -> dict[str, VirtualLidar]:
    """The virtual lidars of clouds that serve as scans, by the frame of the clouds."""
    frames = {
        frame
        for i, kind in selection.kind_of.items()
        if kind == "scan" and streams[i].kind == "cloud"
        for frame in streams[i].frames
    }
    return {
        place.child_frame_id: virtual_lidar(place.child_frame_id, place, config.cloud, tilt)
        for place in fixed
        if place.child_frame_id in frames and place.frame_id == selection.base_frame
    }
