"""Numbers of messages read, used and skipped, by stream and reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StreamCount:
    """Messages of one stream: read from the log, used by the method, skipped by reader or method."""

    read: int
    used: int
    skipped: int


@dataclass(frozen=True, slots=True)
class Counts:
    """`skipped_by_reason` has keys `<stream>.<reason>`; `lost` is damage of unknown size.

    `remarks` are further counts of the reader: out-of-order and repeated stamps, late messages, unused topics.
    """

    streams: Mapping[str, StreamCount]
    skipped_by_reason: Mapping[str, int]
    lost: Mapping[str, int]
    remarks: Mapping[str, int]


def merge_counts(log_counters: Mapping[str, int], method_counters: Mapping[str, int]) -> Counts:
    """The counts of a run, from the counters of the reader and of the method.

    Both use the keys `read.<stream>` (messages passed to the method), `used.<stream>`, `skipped.<stream>.<reason>`
    and `lost.<what>`. Without a counter `used.<stream>` all messages that the method did not skip count as used.
    """
    both = Counter(dict(log_counters))
    both.update(dict(method_counters))
    reasons = {
        key.removeprefix("skipped."): n for key, n in sorted(both.items()) if key.startswith("skipped.")
    }
    names = sorted({key.split(".")[1] for key in both if key.startswith(("read.", "used.", "skipped."))})
    streams = {name: _stream(name, log_counters, method_counters, both) for name in names}
    lost = {key.removeprefix("lost."): n for key, n in sorted(both.items()) if key.startswith("lost.")}
    known = ("read.", "used.", "skipped.", "lost.")
    remarks = {key: n for key, n in sorted(log_counters.items()) if not key.startswith(known)}
    return Counts(streams, reasons, lost, remarks)


def _stream(
    name: str, log_counters: Mapping[str, int], method_counters: Mapping[str, int], both: Mapping[str, int]
) -> StreamCount:
    def skipped(counters: Mapping[str, int]) -> int:
        return sum(n for key, n in counters.items() if key.startswith(f"skipped.{name}."))

    handed_over = log_counters.get(f"read.{name}", 0)
    used = method_counters.get(f"used.{name}", max(handed_over - skipped(method_counters), 0))
    return StreamCount(handed_over + skipped(log_counters), used, skipped(both))
