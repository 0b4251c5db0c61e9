"""Contribution of a session to a run's result: session.npz, the paths of all drives, and the changes between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.loop_closure.trajectory import ClosedTrajectory
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.active_scans import active_keys
from gridslam.lidar_slam.sessions.changes import Change
from gridslam.lidar_slam.sessions.continuation import Continued
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session, renumbered
from gridslam.lidar_slam.sessions.session_file import FILE_NAME, session_bytes
from gridslam.lidar_slam.sessions.session_map import SessionMap
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.maps.preview import Footprint, render_map
from gridslam.methods.base import Doubt, Picture, RunResult, Table

Floats = NDArray[np.float64]

APPEARED, VANISHED = (30, 110, 200), (235, 130, 20)
CHANGES_NOTE = "What the last drive found changed: blue has appeared, orange has vanished."
VIEW_M = 6.0  # largest distance of earlier scans that are compared with the new drive
MAX_RANGE_RATIO = 1.5  # largest ratio of the ranges of two lidars that see about as far
RANGE_QUANTILE = 0.999


def drive_of(log: str, tracker: ScanTracker, scans: Sequence[PreparedScan]) -> Drive:
    """The tracked log as a drive; `scans` are its key scans as they are kept."""
    return Drive(
        log,
        np.array(tracker.path.stamps_ns, np.int64),
        np.array(tracker.path.poses),
        keys=np.array(tracker.path.keys, np.int64),
        scans=scans,
        range_m=range_m_of(scans),
        swing_m=None if tracker.sway is None else tracker.sway.shifts_m,
    )


def constraints_of(closed: ClosedTrajectory, landmarks: Edges | None) -> Constraints:
    """The constraints between the poses of a drive that was mapped on its own."""
    return Constraints(closed.loops, closed.visits, landmarks or Edges.none())


def refuse_repeated_log(session: Session, drive: Drive) -> None:
    """Raises ConfigError: the session has this log already."""
    for number, other in enumerate(session.drives, start=1):
        if np.array_equal(other.stamps_ns, drive.stamps_ns) and np.allclose(
            other.track, drive.track, atol=1e-6
        ):
            raise ConfigError(
                f"{drive.log}: the session has this log already, as drive {number}; continue it with another log"
            )


class SessionFile(NamedTuple):
    """The content of session.npz, and its size and numbers of drives, key scans and parts for the report."""

    content: bytes
    facts: Mapping[str, object]

    @classmethod
    def of(cls, session: Session) -> SessionFile:
        """The file of a session."""
        content = session_bytes(session)
        facts = {
            "size_mb": round(len(content) / 1e6, 3),
            "drives": len(session.drives),
            "key_scans": len(session.poses),
            "parts": len(np.unique(session.parts)),
        }
        return cls(content, facts)

    def added_to(self, result: RunResult) -> RunResult:
        """The result with the file and its facts in the measures."""
        facts = {**self.facts, **_as_mapping(result.measures.get("session"))}
        return replace(
            result,
            files={**result.files, FILE_NAME: self.content},
            measures={**result.measures, "session": facts},
        )


def with_drives(result: RunResult, continued: Continued, drawn: SessionMap) -> RunResult:
    """The result of the last drive with all drives of its session: paths, tables, pictures and measures."""
    session = continued.session
    paths = [session.trajectory(d) for d in range(len(session.drives))]
    joint = joint_trajectory(paths)
    last = len(session.drives) - 1
    newest = [change for change in drawn.changes if change.drive == last]
    layer = GridLayer(drawn.layer, drawn.grid.geometry)
    doubt = result.doubt
    if not continued.is_joined:
        doubt = Doubt("apart", apart_reason(session))
    return replace(
        result,
        trajectory=joint if joint is not None else result.trajectory,
        trajectories={f"trajectory_{d + 1}": path for d, path in enumerate(paths)},
        tables={
            **result.tables,
            "drives": drives_table(session),
            "changes": changes_table(session, drawn.changes),
        },
        layers={**result.layers, "changes": layer},
        pictures={**result.pictures, "changes": changes_picture(drawn.grid, newest)},
        doubt=doubt,
        notes=(*result.notes, *range_notes(session)),
        measures={**result.measures, "session": _measures(continued, newest, joint is not None)},
    )


def _measures(continued: Continued, newest: Sequence[Change], is_joint: bool) -> dict[str, object]:
    return {
        "is_joined": continued.is_joined,
        "pairs_searched": continued.pairs_searched,
        "loops_to_earlier": continued.loops_to_earlier,
        "visits_of_earlier": continued.visits_of_earlier,
        "largest_correction_of_earlier_m": continued.largest_correction_m,
        "appeared": sum(change.kind == "appeared" for change in newest),
        "vanished": sum(change.kind == "vanished" for change in newest),
        "trajectory_of": "all drives" if is_joint else "the last drive: the stamps of the drives overlap",
    }


def apart_reason(session: Session) -> str:
    """The reason, in words, why the new drive is not part of the map."""
    return (
        f"{session.drives[-1].log} was not found to overlap the map of the session: both are kept, side by side, and how they "
        "lie to each other is unknown; a drive that overlaps both joins them"
    )


def joint_trajectory(paths: Sequence[Trajectory]) -> Trajectory | None:
    """All paths in the order of their stamps; None if a stamp would have two poses, as the times of two drives overlap.

    Drives that were cut from one log may overlap: where both have the same stamps, the later drive's poses are used.
    """
    merged: Trajectory | None = None
    for path in sorted(paths, key=lambda one: int(one.stamps_ns[0])):
        if merged is None:
            merged = path
            continue
        start, end = int(path.stamps_ns[0]), int(merged.stamps_ns.max())
        is_earlier = merged.stamps_ns < start
        shared = path.stamps_ns[path.stamps_ns <= end]
        if not np.array_equal(merged.stamps_ns[~is_earlier], shared):
            return None
        merged = Trajectory(
            np.concatenate([merged.stamps_ns[is_earlier], path.stamps_ns]),
            np.concatenate([merged.poses[is_earlier], path.poses]),
        )
    return merged


def drives_table(session: Session) -> Table:
    """One row a drive: its log, part of the map, stamps and poses; trajectory_N.tum is the path of drive N."""
    rows = [
        (
            d + 1,
            drive.log,
            int(session.parts[d]) + 1,
            format_stamp(int(drive.stamps_ns[0])),
            format_stamp(int(drive.stamps_ns[-1])),
            len(drive.stamps_ns),
            len(drive.keys),
        )
        for d, drive in enumerate(session.drives)
    ]
    return Table(("drive", "log", "part", "first_stamp", "last_stamp", "poses", "key_scans"), rows)


def changes_table(session: Session, changes: Sequence[Change]) -> Table:
    """One row a place that changed."""
    columns = (
        *("change", "drive", "log", "x", "y", "yaw", "length_m", "width_m", "cells"),
        *("last_seen_before", "first_seen_after"),
    )
    rows = [
        (
            change.kind,
            change.drive + 1,
            session.drives[change.drive].log,
            *(round(v, 4) for v in (change.x_m, change.y_m, change.yaw_rad, change.length_m, change.width_m)),
            len(change.cells),
            format_stamp(change.before_ns),
            format_stamp(change.after_ns),
        )
        for change in changes
    ]
    return Table(columns, rows)


def changes_picture(grid: OccupancyGrid, changes: Sequence[Change]) -> Picture:
    """The map with the footprints of what has changed."""
    drawn: list[Footprint] = [
        (change.corners, APPEARED if change.kind == "appeared" else VANISHED, "") for change in changes
    ]
    return Picture(np.asarray(render_map(grid, footprints=drawn)), "Changes", CHANGES_NOTE)


def range_notes(session: Session) -> list[str]:
    """A sentence where the lidar of the last drive sees much farther, or less far, than an earlier one."""
    ranges = [drive.range_m for drive in session.drives]
    for number, range_m in enumerate(ranges[:-1], start=1):
        low, high = sorted((range_m, ranges[-1]))
        if high > MAX_RANGE_RATIO * low > 0.0:
            return [
                f"the lidar saw up to {ranges[-1]:.1f} m, that of drive {number} ({session.drives[number - 1].log}) up to "
                f"{range_m:.1f} m: what only one of them saw is not compared"
            ]
    return []


def range_m_of(scans: Sequence[PreparedScan]) -> float:
    """The range (m) within which all but a few returns of a lidar lie; 0 without returns."""
    ranges = [np.hypot(*(scan.returns - scan.viewpoint).T) for scan in scans if len(scan.returns)]
    return float(np.quantile(np.concatenate(ranges), RANGE_QUANTILE)) if ranges else 0.0


def scans_to_compare(session: Session) -> tuple[list[PreparedScan], Floats, Floats, Edges]:
    """The active key scans of earlier drives near the new one, then its own: scans, poses, tracks `(n, 3)`, and loops.

    Earlier drives were assessed before: their own motion is taken as it is.
    """
    from scipy.spatial import cKDTree

    first = int(session.first_key[-2])
    drive = session.drives[-1]
    own = session.poses[first:]
    earlier = np.flatnonzero(np.concatenate(active_keys(session.before(len(session.drives) - 1))))
    near = earlier[cKDTree(own[:, :2]).query(session.poses[earlier, :2])[0] <= VIEW_M]
    rows = np.concatenate([near, np.arange(first, len(session.poses))])
    key = np.full(len(session.poses), -1, np.int64)
    key[rows] = np.arange(len(rows))
    track = se2.compose(own[0], se2.between(drive.key_track[0], drive.key_track))
    return (
        session.scans_at(rows),
        np.asarray(session.poses[rows]),
        np.concatenate([session.poses[near], track]),
        renumbered(session.constraints.loops, key),
    )


def _as_mapping(value: object) -> dict[str, object]:
    return dict(value) if isinstance(value, dict) else {}
