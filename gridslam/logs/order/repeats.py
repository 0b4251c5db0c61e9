"""Skips the second of messages that are in a log twice, because a playback in a loop was recorded or recordings were joined."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order.clock_steps import MIN_STEP_NS, clock_epochs
from gridslam.logs.streams import RecordedStream

MIN_COPIES = 10  # smallest number of stamps of a stream that come again among later ones: two bags of one drive were joined
MIN_REPEATED = 0.5  # fraction of the stamps after a jump back that were there before to the nanosecond

Item = tuple[str, str, Event]  # kind, topic, event


def is_looped(streams: Sequence[RecordedStream], kind_of: Mapping[int, str]) -> bool:
    """Whether the scans (or else the densest stream) have the same stamps again after the clocks have jumped back together."""
    used = [i for i in kind_of if len(streams[i].stamps_ns) > 1]
    stamps = [np.asarray(streams[i].stamps_ns, np.int64) for i in used]
    epochs = clock_epochs(stamps) if len(stamps) > 1 else [_passes(one) for one in stamps]
    scans = [place for place, i in enumerate(used) if kind_of[i] == "scan"]
    for place in scans or [max(range(len(used)), key=lambda k: len(stamps[k]))] if used else []:
        later = epochs[place] > 0
        if later.any() and np.isin(stamps[place][later], stamps[place][~later]).mean() >= MIN_REPEATED:
            return True
    return False


def has_copies(streams: Sequence[RecordedStream], kind_of: Mapping[int, str]) -> bool:
    """Whether a stream has copies of its messages among later ones."""
    return any(copies_among(streams[i].stamps_ns).any() for i in kind_of)


def copies_among(stamps_ns: Sequence[int] | NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask `(n,)` of stamps (ns) that were there before, with later ones between.

    A clock that is set back by a whole number of periods gives stamps again as well, but many of them one after the other.
    """
    stamps = np.asarray(stamps_ns, np.int64)
    is_copy = stamps < np.maximum.accumulate(stamps)
    if np.count_nonzero(is_copy) < MIN_COPIES:
        return np.zeros(len(stamps), np.bool_)
    first = np.unique(stamps, return_index=True)[1]
    is_copy[first] = False
    edges = np.flatnonzero(np.diff(is_copy, prepend=False, append=False))
    for start, end in edges.reshape(-1, 2).tolist():
        if np.ptp(stamps[start:end]) >= MIN_STEP_NS:
            is_copy[start:end] = False
    return is_copy if np.count_nonzero(is_copy) >= MIN_COPIES else np.zeros(len(stamps), np.bool_)


def _passes(stamps: NDArray[np.int64]) -> NDArray[np.int64]:
    """The number of jumps back before each stamp `(n,)` of a stream that is alone."""
    steps_back = np.diff(stamps, prepend=stamps[:1]) < -MIN_STEP_NS
    return np.cumsum(steps_back)


LOOPED = "the recording was played in a loop: what had been played before is left out"
COPIED = (
    "messages were recorded twice, as where two bags of a drive were joined: the second of each is left out"
)


def without_repeats(
    items: Iterable[Item], message_counts: MessageCounts, line: str = LOOPED
) -> Iterator[Item]:
    """The items but for those of a stream that were there before, stamp and content; transforms all stay.

    The first that is left out is found with `line`. A clock that is set back by a whole number of periods gives stamps again as
    well, but not what was measured at them.
    """
    seen: dict[tuple[str, str], set[int]] = {}
    for kind, topic, event in items:
        if kind != "tf":
            contents = seen.setdefault((kind, topic), set())
            content = _content(event)
            if content in contents:
                message_counts.count(f"repeated.{kind}")
                message_counts.find(line)
                continue
            contents.add(content)
        yield kind, topic, event


def _content(event: Event) -> int:
    """A hash of the content of a message, including its stamp."""
    values = (getattr(event, field.name) for field in fields(event))
    return hash(tuple(value.tobytes() if isinstance(value, np.ndarray) else repr(value) for value in values))
