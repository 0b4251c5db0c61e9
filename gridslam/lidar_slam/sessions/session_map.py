"""The map of a session: the newest state of what changed, and what all drives say of the rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.grid_map import LastUpdates, to_probability
from gridslam.lidar_slam.sessions.active_scans import active_keys
from gridslam.lidar_slam.sessions.changes import Change, dilated, find_changes
from gridslam.lidar_slam.sessions.drawn_state import DrawnState
from gridslam.lidar_slam.sessions.evidence import (
    CellFrame,
    Evidence,
    PlacedScans,
    collect_evidence,
    insert_drive,
)
from gridslam.lidar_slam.sessions.session import Session
from gridslam.maps.occupancy import OccupancyGrid

RENEWED_CELLS = 2  # radius around a changed cell that is renewed too: a surface is a few cells thick


@dataclass(frozen=True, slots=True)
class SessionMap:
    """The map, the changes of all drives in order, a layer int16 `(rows, cols)` of them, and all this to be continued.

    The layer has the number of the last drive that changed a cell, counted from 1, negative where something vanished.
    """

    grid: OccupancyGrid
    changes: list[Change]
    layer: NDArray[np.int16]
    drawn: DrawnState


def draw_session(session: Session, resolution_m: float, memory_limit_mb: float) -> SessionMap:
    """Draw the drives one after the other, or only those since the session was drawn, if nothing in that has moved.

    Raises MethodError: the map would exceed the memory limit.
    """
    drawn = session.drawn
    if drawn is not None and not drawn.is_valid_for(session.poses, resolution_m):
        drawn = None
    first = 0 if drawn is None else int(np.searchsorted(session.first_key, len(drawn.poses)))
    drives = [
        PlacedScans.of(session.drives[d].scans, session.poses_of(d))
        for d in range(first, len(session.drives))
    ]
    frame = CellFrame.around(drives, resolution_m, memory_limit_mb, drawn.frame if drawn else None)
    drawn = DrawnState.nothing(frame) if drawn is None else drawn.within(frame)
    for d, drive in enumerate(drives, start=first):
        drawn = _with_drive(drawn, session, d, drive)
    drawn = replace(drawn, poses=session.poses)
    probability = to_probability(drawn.log_odds.copy())
    return SessionMap(OccupancyGrid(probability, frame.geometry), drawn.changes, drawn.layer, drawn)


def _with_drive(drawn: DrawnState, session: Session, d: int, drive: PlacedScans) -> DrawnState:
    """The map with drive number `d` added to it in place."""
    frame = drawn.frame
    own = collect_evidence(drive, frame)
    insert_drive(drawn.log_odds, LastUpdates(frame.rows, frame.cols), drive, frame)
    if not d:
        return replace(drawn, state=own)
    found = find_changes(drawn.state, own, _scans_before(session, d), drive, frame, d)
    changed = np.zeros(drawn.layer.shape, np.bool_)
    for change in found:
        rows, cols = change.cells.T
        drawn.layer[rows, cols] = (d + 1) if change.kind == "appeared" else -(d + 1)
        changed[rows, cols] = True
    renewed = dilated(changed, RENEWED_CELLS) & (own.hits + own.misses > 0)
    drawn.log_odds[renewed] = own.log_odds[renewed]
    state = Evidence(
        np.where(renewed, own.hits, drawn.state.hits + own.hits),
        np.where(renewed, own.misses, drawn.state.misses + own.misses),
    )
    return replace(drawn, state=state, changes=[*drawn.changes, *found])


def _scans_before(session: Session, d: int) -> PlacedScans:
    """The active scans of the drives before number `d`."""
    before = session.before(d)
    rows = np.flatnonzero(np.concatenate(active_keys(before)))
    return PlacedScans.of(before.scans_at(rows), before.poses[rows])
