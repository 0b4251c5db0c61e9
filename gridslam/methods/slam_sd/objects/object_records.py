"""Histories of tagged objects that go on from drive to drive, as a session keeps them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory


def records_of(histories: Iterable[ObjectHistory]) -> ObjectRecords:
    """All estimates of objects, object by object."""
    found = [(history.model.id, estimate) for history in histories for estimate in history.estimates]
    if not found:
        return ObjectRecords.none()
    estimates = [estimate for _, estimate in found]
    return ObjectRecords(
        tuple(name for name, _ in found),
        anchor=np.array([e.anchor for e in estimates], np.int64),
        poses=np.array([e.pose for e in estimates], np.float64),
        covariances=np.array([e.covariance for e in estimates], np.float64),
        stamps_ns=np.array([(e.first_ns, e.last_ns) for e in estimates], np.int64),
        reads=np.array([e.reads for e in estimates], np.int64),
        gain=np.array([e.gain for e in estimates], np.float64),
        closed_yaw=np.array([np.nan if e.closed_yaw is None else e.closed_yaw for e in estimates]),
        gone_ns=np.array([e.gone_ns or 0 for e in estimates], np.int64),
        is_gone=np.array([e.gone_ns is not None for e in estimates]),
    )


def estimates_in(records: ObjectRecords) -> dict[str, list[ObjectEpisode]]:
    """The estimates of each object, by its id, in the order in which they are kept."""
    found: dict[str, list[ObjectEpisode]] = defaultdict(list)
    for k, name in enumerate(records.ids):
        yaw = float(records.closed_yaw[k])
        found[name].append(
            ObjectEpisode(
                int(records.anchor[k]),
                records.poses[k],
                records.covariances[k],
                first_ns=int(records.stamps_ns[k, 0]),
                last_ns=int(records.stamps_ns[k, 1]),
                reads=int(records.reads[k]),
                gain=float(records.gain[k]),
                closed_yaw=None if np.isnan(yaw) else yaw,
                gone_ns=int(records.gone_ns[k]) if records.is_gone[k] else None,
            )
        )
    return dict(found)


def after_earlier_drives(
    histories: Iterable[ObjectHistory], earlier: ObjectRecords, first_key: int
) -> list[ObjectHistory]:
    """Histories whose estimates follow those of earlier drives; the new drive's key scans are numbered from `first_key`."""
    known = estimates_in(earlier)
    return [
        ObjectHistory(
            history.model,
            estimates=[
                *known.get(history.model.id, []),
                *(replace(e, anchor=e.anchor + first_key) for e in history.estimates),
            ],
        )
        for history in histories
    ]
