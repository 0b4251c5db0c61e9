"""What it means that nothing was read of an object: a silent antenna is information as well."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.evidence import SeenRound, SeenScan, gather
from gridslam.methods.slam_sd.object_config import ObjectsConfig
from gridslam.methods.slam_sd.object_filter import ObjectFilter
from gridslam.methods.slam_sd.things import Thing
from gridslam.sensors.rfid import AntennaModel, Rounds, range_profile

Floats = NDArray[np.float64]


def log_silence(
    thing: Thing, pose: Floats, rounds: Sequence[SeenRound], seen: SeenScan, model: AntennaModel
) -> float:
    """log P(no read of any of its tags in these rounds | the object is at a pose (3,)); `seen` shows what hides them."""
    points = se2.transform_points(seen.pose, seen.scan.returns)
    placed = Rounds(
        np.array([r.antenna for r in rounds]),
        np.zeros(len(rounds), np.int64),
        seen.viewpoint[None],
        range_profile(points, seen.viewpoint)[None],
    )
    silent = np.zeros(len(rounds), np.bool_)
    return float(placed.log_likelihood(se2.compose(pose[None], thing.tags), silent, model).sum())


def sees_nothing(
    thing: Thing,
    pose: Floats,
    scans: Sequence[SeenScan],
    rounds: Sequence[SeenRound],
    config: ObjectsConfig,
) -> bool:
    """Whether the last scans speak against an object at a pose (3,) of the front end's frame."""
    since = scans[-1].stamp_ns - round(1e9 * (config.lead_s + config.pause_s))
    recent = [seen for seen in scans if seen.stamp_ns >= since]
    evidence = gather(thing, recent, rounds[-1:], pose[:2], config)
    return ObjectFilter(thing, evidence, None, config).judge(pose) < 0.0
