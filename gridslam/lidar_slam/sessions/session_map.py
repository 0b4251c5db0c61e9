"""The map of a session: the newest state of what changed, and what all drives say of the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.grid_map import LastUpdates, to_probability
from gridslam.lidar_slam.sessions.changes import Change, dilated, find_changes
from gridslam.lidar_slam.sessions.evidence import (
    CellFrame,
    Evidence,
    PlacedScans,
    collect_evidence,
    insert_drive,
)
from gridslam.lidar_slam.sessions.session import Session
from gridslam.maps.occupancy import OccupancyGrid

RENEWED_CELLS = 2  # about a changed cell: a surface is a few cells thick


@dataclass(frozen=True, slots=True)
class SessionMap:
    """The map, the changes of all drives in order, and a layer int16 `(rows, cols)` of them.

    The layer has the number of the last drive that changed a cell, counted from 1, negative where something vanished.
    """

    grid: OccupancyGrid
    changes: list[Change]
    layer: NDArray[np.int16]


def draw_session(session: Session, resolution_m: float, memory_limit_mb: float) -> SessionMap:
    """Draw the drives one after the other. Raises MethodError: the map would exceed the memory limit."""
    drives = [PlacedScans.of(drive.scans, session.poses_of(d)) for d, drive in enumerate(session.drives)]
    frame = CellFrame.around(drives, resolution_m, memory_limit_mb)
    values = np.full((frame.rows, frame.cols), np.nan, np.float32)
    last = LastUpdates(frame.rows, frame.cols)
    state = collect_evidence(drives[0], frame)
    insert_drive(values, last, drives[0], frame)
    layer = np.zeros(values.shape, np.int16)
    changes: list[Change] = []
    for d in range(1, len(drives)):
        own = collect_evidence(drives[d], frame)
        insert_drive(values, last, drives[d], frame)
        found = find_changes(state, own, _together(drives[:d]), drives[d], frame, d)
        changes += found
        changed = np.zeros(values.shape, np.bool_)
        for change in found:
            rows, cols = change.cells.T
            layer[rows, cols] = (d + 1) if change.kind == "appeared" else -(d + 1)
            changed[rows, cols] = True
        renewed = dilated(changed, RENEWED_CELLS) & (own.hits + own.misses > 0)
        values[renewed] = own.log_odds[renewed]
        state = Evidence(
            np.where(renewed, own.hits, state.hits + own.hits),
            np.where(renewed, own.misses, state.misses + own.misses),
        )
    return SessionMap(OccupancyGrid(to_probability(values), frame.geometry), changes, layer)


def _together(drives: list[PlacedScans]) -> PlacedScans:
    return PlacedScans(
        [part for drive in drives for part in drive.endpoints],
        np.concatenate([drive.viewpoints for drive in drives]),
        np.concatenate([drive.stamps_ns for drive in drives]),
    )
