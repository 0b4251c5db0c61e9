"""The partners with which each scan is compared: some from other passages through the same place, some from its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.kernels.grids.free_space import Partners

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SPACING_M = 0.5  # distance along the path between scans that are compared
VIEW_M = 6.0  # scans farther apart are not compared
APART_M = 25.0  # smallest travel between two passages
MAX_PASSAGES = 6  # largest number of passages with which one scan is compared
OWN_STEPS = (-8, -4, 4, 8)  # scans before and after, of the same passage


@dataclass(frozen=True, slots=True)
class Passages:
    """The partners of every scan, and the distance driven up to it (m) `(n,)`."""

    partners: Partners
    travel_m: Floats

    @property
    def is_revisited(self) -> NDArray[np.bool_]:
        """Mask `(n,)` of the scans with a partner in another passage."""
        counts = np.zeros(len(self.travel_m), np.int64)
        scan = np.repeat(np.arange(len(counts)), np.diff(self.partners.first))
        np.add.at(counts, scan, self.partners.is_other)
        return np.asarray(counts > 0)

    def others(self, scan: int) -> Ints:
        """Indices `(k,)` of the partners of a scan in other passages."""
        rows = slice(self.partners.first[scan], self.partners.first[scan + 1])
        return self.partners.scan[rows][self.partners.is_other[rows]]


def spaced_scans(travel_m: Floats) -> Ints:
    """Rows of scans about `SPACING_M` apart."""
    return np.flatnonzero(np.diff(np.floor(travel_m / SPACING_M), prepend=-1.0) > 0)


def find_passages(poses: Floats, travel_m: Floats) -> Passages:
    """For each scan the nearest one of other passages, at most `MAX_PASSAGES` of them spread over the log, and `OWN_STEPS`."""
    near = cKDTree(poses[:, :2]).query_ball_point(poses[:, :2], VIEW_M, return_sorted=True)
    first, scans, is_other = [0], [], []
    for i, found in enumerate(near):
        others = _one_a_passage(i, np.asarray(found, np.int64), poses, travel_m)
        own = [i + step for step in OWN_STEPS if 0 <= i + step < len(poses)]
        scans += [*others, *own]
        is_other += [True] * len(others) + [False] * len(own)
        first.append(len(scans))
    partners = Partners(np.array(first, np.int64), np.array(scans, np.int64), np.array(is_other, np.bool_))
    return Passages(partners, travel_m)


def _one_a_passage(scan: int, near: Ints, poses: Floats, travel_m: Floats) -> list[int]:
    """The nearest scan of each other passage among the near scans; at most `MAX_PASSAGES` of them."""
    apart = near[np.abs(travel_m[near] - travel_m[scan]) > APART_M]
    if not len(apart):
        return []
    gap = round(2.0 * VIEW_M / SPACING_M)
    passages = np.split(apart, np.flatnonzero(np.diff(apart) > gap) + 1)
    if len(passages) > MAX_PASSAGES:
        chosen = np.linspace(0, len(passages) - 1, MAX_PASSAGES).astype(np.int64)
        passages = [passages[k] for k in chosen]
    away = [np.hypot(*(poses[p, :2] - poses[scan, :2]).T) for p in passages]
    return [int(p[np.argmin(d)]) for p, d in zip(passages, away, strict=True)]
