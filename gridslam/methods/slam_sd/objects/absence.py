"""Evidence that an object is gone: rounds that did not read its tags, and scans that do not see it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.object_filter import ObjectFilter
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.tag_visits import PAUSE_NS
from gridslam.methods.slam_sd.objects.visit_evidence import (
    InventoryRound,
    KeyScanObservation,
    gather_evidence,
)
from gridslam.sensors.rfid import AntennaModel, RoundGeometry, range_profile

Floats = NDArray[np.float64]

LEAD_NS = 3_000_000_000  # scans this long before the first read of a visit are used as well


def log_silence(
    model: ObjectModel,
    pose: Floats,
    rounds: Sequence[InventoryRound],
    scan: KeyScanObservation,
    antenna: AntennaModel,
) -> float:
    """log P(no tag of the object is read in these rounds | the object is at a pose (3,)); `scan` shows what hides the tags."""
    points = se2.transform_points(scan.pose, scan.scan.returns)
    geometry = RoundGeometry(
        np.array([r.antenna for r in rounds]),
        np.zeros(len(rounds), np.int64),
        scan.viewpoint[None],
        range_profile(points, scan.viewpoint)[None],
    )
    silent = np.zeros(len(rounds), np.bool_)
    return float(geometry.log_likelihood(se2.compose(pose[None], model.tags), silent, antenna).sum())


def scans_see_nothing(
    model: ObjectModel,
    pose: Floats,
    scans: Sequence[KeyScanObservation],
    rounds: Sequence[InventoryRound],
    settings: ObjectSettings,
) -> bool:
    """Whether the last scans are more likely without the object than with it at a pose (3,) in the front end's frame."""
    since = scans[-1].stamp_ns - (LEAD_NS + PAUSE_NS)
    recent = [scan for scan in scans if scan.stamp_ns >= since]
    evidence = gather_evidence(model, recent, rounds[-1:], pose[:2])
    return ObjectFilter(model, evidence, None, settings).log_likelihood_ratio(pose) < 0.0
