"""Visits: periods during which an object's tags are read. The object may be moved unseen between two visits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from gridslam.methods.slam_sd.objects.visit_evidence import InventoryRound

PAUSE_NS = 4_000_000_000  # time without a read after which a visit is over


@dataclass(slots=True)
class TagVisit:
    """Stamps of the first and last read of an object, and the number of reads."""

    first_ns: int
    last_ns: int
    reads: int = 1

    @property
    def middle_ns(self) -> int:
        """The stamp halfway between the first and the last read."""
        return (self.first_ns + self.last_ns) // 2


class OpenVisits:
    """The visits that are going on, by the reads of the objects' tags."""

    def __init__(self, object_of_tag: Mapping[str, str]) -> None:
        self._object_of_tag = object_of_tag
        self._visits: dict[str, TagVisit] = {}
        self.counters: Counter[str] = Counter()

    def __contains__(self, name: str) -> bool:
        return name in self._visits

    def add(self, inventory: InventoryRound) -> None:
        """Add one round; several tags of one object count as one read, tags that the database lacks are counted."""
        known = {self._object_of_tag[tag] for tag in inventory.tag_ids if tag in self._object_of_tag}
        unknown = sum(tag not in self._object_of_tag for tag in inventory.tag_ids)
        if unknown:
            self.counters["tags.unknown_id"] += unknown
        for name in sorted(known):
            visit = self._visits.get(name)
            if visit is None:
                self._visits[name] = TagVisit(inventory.stamp_ns, inventory.stamp_ns)
            else:
                visit.last_ns = max(visit.last_ns, inventory.stamp_ns)
                visit.reads += 1

    def take_ended(self, now_ns: int | None) -> dict[str, TagVisit]:
        """Remove and return the visits that are over; at the end of the log (None) all of them."""
        ended = {
            name: visit
            for name, visit in sorted(self._visits.items())
            if now_ns is None or now_ns - visit.last_ns > PAUSE_NS
        }
        for name in ended:
            del self._visits[name]
        return ended
