"""Rewrite a log in another format, event by event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Transform
from gridslam.logs.log import Log
from gridslam.logs.stamps import NS_PER_S
from gridslam.logs.streams import StreamInfo
from gridslam.logs.write import TRUTH_TOPIC, open_writer


@dataclass(frozen=True, slots=True)
class Conversion:
    """What was written: messages by topic; and topics left out because no event stands for their type."""

    written: dict[str, int]
    left_out: list[str]


def convert_log(
    log: Log,
    output: Path,
    topics: Collection[str] = (),
    start_s: float | None = None,
    end_s: float | None = None,
    force: bool = False,
) -> Conversion:
    """Write a log's streams, the truth too; `start_s` and `end_s` count from the log's first stamp, ends
    included.

    Mountings are always written. Raises ConfigError for a topic that the log lacks, LogError where the
    output exists.
    """
    streams = [info for info in log.streams if info.used or info.kind == "truth"]
    known = {info.topic for info in streams}
    for topic in topics:
        if topic not in known:
            raise ConfigError(
                f"--topics: the log has no topic {topic!r}; it has: {', '.join(sorted(known)) or 'none'}"
            )
    names = _names([info for info in streams if not topics or info.topic in topics])
    origin = min((i.first_stamp_ns for i in streams if i.first_stamp_ns is not None), default=0)
    first = None if start_s is None else origin + round(start_s * NS_PER_S)
    last = None if end_s is None else origin + round(end_s * NS_PER_S)
    written: Counter[str] = Counter()
    with open_writer(output, force) as writer:
        for topic, event in log.events_by_topic(with_truth=True):
            if isinstance(event, Transform) and event.is_static:
                writer.write(event)
                continue
            if topic not in names or (first is not None and event.stamp_ns < first):
                continue
            if last is not None and event.stamp_ns > last:
                continue
            writer.write(event, names[topic])
            written[topic] += 1
    left_out = [f"{i.topic} ({i.type})" for i in log.streams if not i.used and i.kind != "truth" and i.count]
    return Conversion(dict(sorted(written.items())), left_out)


def _names(streams: list[StreamInfo]) -> dict[str, str | None]:
    """The topic under which each stream is written. Names that are no ROS topics give way to the usual one
    of their kind,
    unless two streams of a kind would meet there."""
    counts = Counter(info.kind for info in {info.topic: info for info in streams}.values())
    names: dict[str, str | None] = {}
    for info in streams:
        if info.kind == "truth":
            names[info.topic] = TRUTH_TOPIC
        elif info.topic.startswith("/"):
            names[info.topic] = info.topic
        elif counts[info.kind] == 1 or info.kind in ("tf", "image", "depth", "disparity", "camera_info"):
            names[info.topic] = None
        else:
            names[info.topic] = (
                "/" + "".join(c if c.isalnum() else "_" for c in info.topic).strip("_").lower()
            )
    return names
