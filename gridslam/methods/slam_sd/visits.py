"""Visits: spells during which an object's tags are read; a move between two of them goes unseen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from gridslam.methods.slam_sd.evidence import SeenRound


@dataclass(slots=True)
class Visit:
    """First and last read of an object, and how many there were."""

    first_ns: int
    last_ns: int
    reads: int = 1


class VisitBook:
    """Which objects are being visited, by the reads of their tags."""

    def __init__(self, thing_of_tag: Mapping[str, str], pause_s: float) -> None:
        self._thing_of_tag = thing_of_tag
        self._pause_ns = round(1e9 * pause_s)
        self.open: dict[str, Visit] = {}
        self.counters: Counter[str] = Counter()

    def add(self, seen: SeenRound) -> None:
        """Take in one round; tags that the database lacks are counted. Two tags of one object are one read of it."""
        known = {self._thing_of_tag[tag] for tag in seen.tag_ids if tag in self._thing_of_tag}
        unknown = sum(tag not in self._thing_of_tag for tag in seen.tag_ids)
        if unknown:
            self.counters["tags.unknown_id"] += unknown
        for name in sorted(known):
            visit = self.open.get(name)
            if visit is None:
                self.open[name] = Visit(seen.stamp_ns, seen.stamp_ns)
            else:
                visit.last_ns = max(visit.last_ns, seen.stamp_ns)
                visit.reads += 1

    def take_ended(self, now_ns: int | None) -> dict[str, Visit]:
        """The visits without a read for the length of a pause; all of them at the end of the log (`None`)."""
        ended = {
            name: visit
            for name, visit in sorted(self.open.items())
            if now_ns is None or now_ns - visit.last_ns > self._pause_ns
        }
        for name in ended:
            del self.open[name]
        return ended
