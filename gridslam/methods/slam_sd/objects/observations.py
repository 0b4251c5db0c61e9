"""The key scans and inventory rounds of a run, in the front end's frame, and the evidence of a visit among them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.absence import LEAD_NS
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.tag_visits import TagVisit
from gridslam.methods.slam_sd.objects.visit_evidence import (
    InventoryRound,
    KeyScanObservation,
    VisitEvidence,
    gather_evidence,
)

Floats = NDArray[np.float64]

TRAIL_NS = 1_000_000_000  # scans and silent rounds this long after the last read are used as well


class RunObservations:
    """All key scans and inventory rounds so far."""

    def __init__(self) -> None:
        self.scans: list[KeyScanObservation] = []
        self.rounds: list[InventoryRound] = []

    @property
    def last_key(self) -> int:
        """Index of the last key scan."""
        return len(self.scans) - 1

    def key_nearest_to(self, stamp_ns: int) -> int:
        """Index of the key scan nearest to a stamp."""
        return min(range(len(self.scans)), key=lambda i: abs(self.scans[i].stamp_ns - stamp_ns))

    def map_in_track(self, key: int, path: Floats) -> Floats:
        """The map's pose (3,) in the front end's frame, by which they agree at a key scan; `path` `(k, 3)` is in the map."""
        return se2.compose(self.scans[key].pose, se2.inverse(path[key]))

    def readers(self, model: ObjectModel, visit: TagVisit) -> Floats:
        """Positions `(r, 2)` of the antennas that read one of the object's tags during a visit."""
        found = [
            inventory.antenna[:2]
            for inventory in self.rounds
            if visit.first_ns <= inventory.stamp_ns <= visit.last_ns
            and any(tag in inventory.tag_ids for tag in model.tag_ids)
        ]
        return np.array(found).reshape(-1, 2)

    def evidence(
        self, model: ObjectModel, visit: TagVisit, centre: Floats | None = None
    ) -> VisitEvidence | None:
        """Scans and rounds from shortly before the first read to shortly after the last one; None without any return.

        `centre` (2,) is roughly where the object is; if absent, the mean position of the readers.
        """
        first, last = visit.first_ns - LEAD_NS, visit.last_ns + TRAIL_NS
        scans = [scan for scan in self.scans if first <= scan.stamp_ns <= last] or self.scans[-1:]
        rounds = [inventory for inventory in self.rounds if first <= inventory.stamp_ns <= last]
        if not sum(len(scan.scan.returns) for scan in scans):
            return None
        if centre is None:
            centre = self.readers(model, visit).mean(axis=0)
        return gather_evidence(model, scans, rounds, centre)
