"""Gating of reads: visits with too few reads are false, unless they fit to where the object was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.pose_prior import PriorEstimate
from gridslam.methods.slam_sd.objects.tag_visits import TagVisit

Floats = NDArray[np.float64]

# Visits whose key scans are closer than this many antenna ranges may read the same object
SAME_PLACE_RANGES = 2.0


class ReadGate:
    """Decides which visits are believed, and remembers the places of the others."""

    def __init__(self, settings: ObjectSettings) -> None:
        self._settings = settings
        self._rejected: dict[str, list[tuple[int, int]]] = {}  # key scans of rejected visits, and their reads

    def accepts(
        self,
        model: ObjectModel,
        visit: TagVisit,
        key: int,
        readers: Floats,
        earlier: PriorEstimate | None,
        path: Floats,
    ) -> bool:
        """Whether the reads of a visit to the object `model` are believed.

        They are if there are enough of them, if all came from near the object's earlier place, or if there are enough together
        with those of rejected visits nearby. `key` is the key scan in the middle of the visit, `readers` `(r, 2)` are the
        antennas' positions, `path` `(k, 3)` the poses of the key scans.
        """
        min_reads = self._settings.objects.min_reads
        if visit.reads >= min_reads or self._is_near_earlier_place(model, readers, earlier):
            return True
        places = self._rejected.setdefault(model.id, [])
        radius_m = SAME_PLACE_RANGES * self._settings.objects.antenna.range_m
        before = sum(
            reads for other, reads in places if float(np.hypot(*(path[other] - path[key])[:2])) < radius_m
        )
        places.append((key, visit.reads))
        return before + visit.reads >= min_reads

    def _is_near_earlier_place(
        self, model: ObjectModel, readers: Floats, earlier: PriorEstimate | None
    ) -> bool:
        """Whether all readers `(r, 2)` were within range of the earlier place."""
        if earlier is None:
            return False
        place = se2.compose(earlier.pose, np.array([*model.centre, 0.0]))[:2]
        radius_m = self._settings.objects.antenna.range_m + model.radius_m
        return bool(len(readers)) and float(np.hypot(*(readers - place).T).max()) < radius_m
