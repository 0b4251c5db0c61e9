"""Disagreement of a log with the session in which it was localized: places that have changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan, Transform
from gridslam.lidar_slam.config import ScanConfig
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session
from gridslam.lidar_slam.sessions.session_map import draw_session
from gridslam.logs.open import open_log
from gridslam.maps.occupancy import GridLayer
from gridslam.maps.preview import render_map
from gridslam.methods.base import Picture, Table
from gridslam.runs.run import Run
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

SPACING = KeyScanSpacing(distance_m=0.25, rotation_rad=0.25)
MEMORY_LIMIT_MB = 1024.0
NEW, GONE = (30, 110, 200), (235, 130, 20)
NOTE = "Where the place differs from the map: blue stands now and did not, orange stood and does not."


def with_disagreement(run: Run, session: Session) -> Run:
    """The run with a layer, a table and a picture `disagreement`; unchanged if the log has no scan at a trusted pose.

    The layer is 1 where a surface stands in space that the session saw free, -1 where a surface of the session is gone.
    """
    scans, poses = _placed_scans(run)
    if not scans or run.occupancy is None:
        return run
    stamps = np.array([scan.stamp_ns for scan in scans], np.int64)
    drive = Drive(run.log_path.name, stamps, poses, keys=np.arange(len(scans)), scans=scans)
    whole = Session(
        (*session.drives, drive),
        np.concatenate([session.poses, poses]),
        np.append(session.parts, 0),
        Constraints.none(),
        drawn=session.drawn,
    )
    last = len(session.drives)
    drawn = draw_session(whole, run.occupancy.geometry.resolution_m, MEMORY_LIMIT_MB)
    changes = [change for change in drawn.changes if change.drive == last]
    values = np.where(np.abs(drawn.layer) == last + 1, np.sign(drawn.layer), 0).astype(np.int8)
    drawing = [(c.corners, NEW if c.kind == "appeared" else GONE, "") for c in changes]
    picture = Picture(
        np.asarray(render_map(run.occupancy, run.result.trajectory, footprints=drawing)), "Disagreement", NOTE
    )
    rows = [
        (
            "new" if c.kind == "appeared" else "gone",
            *(round(v, 4) for v in (c.x_m, c.y_m, c.length_m, c.width_m)),
            c.after_ns,
        )
        for c in changes
    ]
    table = Table(("state", "x", "y", "length_m", "width_m", "stamp_ns"), rows)
    result = run.result
    measures = {
        "new": sum(c.kind == "appeared" for c in changes),
        "gone": sum(c.kind == "vanished" for c in changes),
    }
    return replace(
        run,
        result=replace(
            result,
            layers={**result.layers, "disagreement": GridLayer(values, drawn.grid.geometry)},
            tables={**result.tables, "disagreement": table},
            pictures={**result.pictures, "disagreement": picture},
            measures={**result.measures, "disagreement": measures},
        ),
    )


def _placed_scans(run: Run) -> tuple[list[PreparedScan], NDArray[np.float64]]:
    """Scans of the log some way apart at trusted poses of the run, with these poses `(k, 3)`."""
    path = run.result.trajectory.sorted()
    scans: list[PreparedScan] = []
    poses: list[NDArray[np.float64]] = []
    extrinsics: dict[str, LidarExtrinsics] = {}
    with open_log(run.log_path, run.config.log, ("scan",)) as log:
        for event in log.events():
            if isinstance(event, Transform) and event.is_static:
                extrinsics[event.child_frame_id] = extrinsics_of(event)
            if not isinstance(event, LaserScan) or not _is_trusted(run, event.stamp_ns):
                continue
            pose, inside = path.at(np.array([event.stamp_ns], np.int64))
            if not inside[0] or (poses and not SPACING.is_due(poses[-1], pose[0])):
                continue
            own = extrinsics.get(event.frame_id, LidarExtrinsics(np.zeros(3)))
            scan = prepare_scan(event, own, np.zeros(3), ScanConfig())
            if len(scan.returns):
                scans.append(scan)
                poses.append(pose[0])
    return scans, np.array(poses).reshape(-1, 3)


def _is_trusted(run: Run, stamp_ns: int) -> bool:
    return not any(first <= stamp_ns <= last for first, last in run.result.untrusted_ns)
