"""Counts of messages that were read, skipped and lost, with the reasons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection


class MessageCounts:
    """Counters for the report and, for the user, one line for each kind of fault with its first place.

    `unusable` are the messages of each stream, by its index in the source, that were looked at and left out.
    """

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self.unusable: Counter[int] = Counter()
        self._notes: dict[str, str] = {}
        self._first: dict[str, str] = {}
        self._findings: set[str] = set()

    def count(self, key: str, number: int = 1) -> None:
        """Count something that is not a fault."""
        self.counters[key] += number

    def skip(self, stream: str, reason: str, where: str, number: int = 1) -> None:
        """Count messages of a stream that were left out (`skipped.<stream>.<reason>`)."""
        self._add(f"skipped.{stream}.{reason}", where, number)

    def lose(self, what: str, where: str, number: int = 1) -> None:
        """Count damage that took an unknown number of messages with it (`lost.<what>`)."""
        self._add(f"lost.{what}", where, number)

    def note(self, line: str) -> None:
        """Keep a line for the user, once."""
        self._notes.setdefault(line, line)

    def find(self, line: str) -> None:
        """Keep a line about what contradicts itself or had to be assumed, once; with --strict it is an error."""
        self.note(line)
        self._findings.add(line)

    @property
    def has_findings(self) -> bool:
        """Whether something contradicts itself, or had to be assumed."""
        return bool(self._findings)

    @property
    def problems(self) -> list[str]:
        """Lines for the user: notes, then each kind of loss with its count and first place."""
        lines = list(self._notes)
        for key, where in self._first.items():
            verb, _, what = key.partition(".")
            lines.append(f"{verb} {self.counters[key]} x {what.replace('_', ' ')}, first at {where}")
        return lines

    @property
    def is_lossy(self) -> bool:
        """Whether something in the log could not be used."""
        return bool(self._first)

    def absorb(self, other: MessageCounts, streams: Collection[str] | None = None) -> None:
        """Add the counts of another; given `streams`, skipped messages of these only."""

        def concerns(key: str) -> bool:
            return streams is None or not key.startswith("skipped.") or key.split(".")[1] in streams

        self.counters.update({key: number for key, number in other.counters.items() if concerns(key)})
        for line in other._notes:
            self.note(line)
        self._findings |= other._findings
        for key, where in other._first.items():
            if concerns(key):
                self._first.setdefault(key, where)

    def _add(self, key: str, where: str, number: int) -> None:
        self.counters[key] += number
        self._first.setdefault(key, where)
