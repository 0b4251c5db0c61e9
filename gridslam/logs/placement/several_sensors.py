"""Logs with several lidars or IMUs: which are used, and whether each lidar has a place on the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gridslam.core.errors import ConfigError
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.placement import extrinsics
from gridslam.logs.selection import StreamSelection
from gridslam.logs.streams import RecordedStream


def note_choice(
    streams: Sequence[RecordedStream],
    kind_of: Mapping[int, str],
    config: LogConfig,
    message_counts: MessageCounts,
) -> None:
    """Note which lidars are used together, and which of several IMUs is."""
    lidars = [streams[i].label for i, kind in kind_of.items() if kind == "scan"]
    if len(lidars) > 1:
        message_counts.note(
            f"{len(lidars)} lidars are used together: {', '.join(lidars)}; log.topics.scan names those to use"
        )
    used = [streams[i].label for i, kind in kind_of.items() if kind == "imu"]
    imus = [s.label for s in streams if s.kind == "imu" and len(s.stamps_ns)]
    if used and len(imus) > 1 and "imu" not in config.topics:
        message_counts.note(f"of the IMUs {', '.join(imus)}, {used[0]} is used; log.topics.imu names another")


def refuse_unknown_places(
    streams: Sequence[RecordedStream],
    selection: StreamSelection,
    frames: Sequence[str],
    tree: extrinsics.Tree,
) -> None:
    """Raises ConfigError: of several lidars, one of the `frames` has no place on the robot by the `tree` of transforms."""
    base = selection.base_frame
    lidars = [streams[i] for i, kind in selection.kind_of.items() if kind == "scan"]
    if len(lidars) < 2:
        return
    on_robot = extrinsics.ancestors(tree, base).keys()
    lost = [f for f in frames if f != base and not on_robot & extrinsics.ancestors(tree, f).keys()]
    if lost:
        others = ", ".join(s.topic for s in lidars if lost[0] not in s.frames)
        raise ConfigError(
            f"log.extrinsics.{lost[0]}: the log has {len(lidars)} lidars and no transform from {base} to this one. Give it "
            f"with x, y, yaw, or use the others only: log: {{topics: {{scan: [{others}]}}}}"
        )
