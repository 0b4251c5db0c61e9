"""The map of a session: the newest state of what changed, and what all drives say of the rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.grid_map import UPDATE, LastUpdates, to_probability
from gridslam.lidar_slam.sessions.active_scans import active_keys
from gridslam.lidar_slam.sessions.changes import Change, at_ratio, dilated, find_changes
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
SAME_WALL_CELLS = 2  # largest distance of the cells in which two drives see one wall
MET_RATIO = 0.25  # smallest ratio of hits to all evidence, in a cell of a wall that beams graze
OCCUPIED = float(np.log(0.65 / 0.35))  # log-odds of a wall, at the usual threshold of maps

Floats32 = NDArray[np.float32]


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
    """The map with drive number `d` added to it."""
    frame = drawn.frame
    own = collect_evidence(drive, frame)
    alone = np.full(drawn.layer.shape, np.nan, np.float32)
    insert_drive(alone, LastUpdates(frame.rows, frame.cols), drive, frame)
    if not d:
        return replace(drawn, log_odds=alone, state=own)
    found = find_changes(
        before=drawn.state, after=own, earlier=_scans_before(session, d), later=drive, frame=frame, drive=d
    )
    changed = np.zeros(drawn.layer.shape, np.bool_)
    for change in found:
        rows, cols = change.cells.T
        drawn.layer[rows, cols] = (d + 1) if change.kind == "appeared" else -(d + 1)
        changed[rows, cols] = True
    renewed = dilated(changed, RENEWED_CELLS) & (own.hits + own.misses > 0)
    log_odds = joined_log_odds(drawn.log_odds, alone, drawn.state, own)
    log_odds[renewed] = alone[renewed]
    state = Evidence(
        np.where(renewed, own.hits, drawn.state.hits + own.hits),
        np.where(renewed, own.misses, drawn.state.misses + own.misses),
    )
    return replace(drawn, log_odds=log_odds, state=state, changes=[*drawn.changes, *found])


def joined_log_odds(before: Floats32, alone: Floats32, state: Evidence, own: Evidence) -> Floats32:
    """Log-odds of the map and of a new drive's own map together; `state` and `own` are the evidence of both.

    Beams that graze a wall pass through cells in which another drive met it, as the poses of two drives differ by a part of a
    cell. A wall that both met stands, therefore, also where their sum says otherwise in all cells around.
    """
    limit = UPDATE.limit
    summed = np.clip(np.nan_to_num(before) + np.nan_to_num(alone), -limit, limit)
    summed[np.isnan(before) & np.isnan(alone)] = np.nan
    erased = _met_by_both(state, own) & ~dilated(summed > OCCUPIED, SAME_WALL_CELLS)
    summed[erased] = UPDATE.hit
    return np.asarray(summed)


def _met_by_both(one: Evidence, other: Evidence) -> NDArray[np.bool_]:
    """Cells in which one of two drives met something, and the other one met something in or beside them."""
    met = [at_ratio(evidence, MET_RATIO, 1) for evidence in (one, other)]
    return (met[0] & dilated(met[1], SAME_WALL_CELLS)) | (met[1] & dilated(met[0], SAME_WALL_CELLS))


def _scans_before(session: Session, d: int) -> PlacedScans:
    """The active scans of the drives before number `d`."""
    before = session.before(d)
    rows = np.flatnonzero(np.concatenate(active_keys(before)))
    return PlacedScans.of(before.scans_at(rows), before.poses[rows])
