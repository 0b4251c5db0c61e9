"""Rewrite a log in another format, event by event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

from gridslam.core.errors import ConfigError
from gridslam.core.files import refuse_to_replace
from gridslam.core.messages import Event, StereoPair, Transform
from gridslam.core.stamps import END_S, NS_PER_S
from gridslam.logs.encoding.cameras import camera_of
from gridslam.logs.kinds import KINDS, TRUTH_TOPIC, WITHOUT_TABLE
from gridslam.logs.log import Log
from gridslam.logs.streams import StreamInfo
from gridslam.logs.write import open_writer


@dataclass(frozen=True, slots=True)
class Conversion:
    """The result of a conversion: messages written by topic, and topics left out because nothing uses their type."""

    written: dict[str, int]
    left_out: list[str]


def convert_log(
    log: Log,
    output: Path,
    topics: Collection[str] = (),
    start_s: float | None = None,
    end_s: float | None = None,
    force: bool = False,
    as_rosbag2: bool = False,
) -> Conversion:
    """Write the streams of a log, including the truth; `as_rosbag2`: to a rosbag2 folder.

    Where `topics` are given, only their streams are written. `start_s` and `end_s` count from the log's first stamp, both
    included. Extrinsics are always written. Raises ConfigError for a topic that the log lacks, for a span that holds no
    message, and where the output exists; with `force` where it is not a log of its format, or the log that is read.
    """
    refuse_to_replace(output, [log.path])
    for option, seconds in (("--start", start_s), ("--end", end_s)):
        if seconds is not None and not 0.0 <= seconds <= END_S:
            raise ConfigError(f"{option} {seconds:g}: expected seconds from 0 to {END_S}")
    if start_s is not None and end_s is not None and not start_s <= end_s:
        raise ConfigError(f"--start {start_s:g} --end {end_s:g}: the end lies before the start")
    streams = [info for info in log.streams if info.used or info.kind == "truth"]
    known = {info.topic for info in streams}
    for topic in topics:
        if topic not in known:
            raise ConfigError(
                f"--topics: the log has no topic {topic!r}; it has: {', '.join(sorted(known)) or 'none'}"
            )
    wanted = [info for info in streams if not topics or info.topic in topics]
    if output.suffix != ".mcap" and not as_rosbag2:  # a CSV folder
        wanted = [info for info in wanted if info.kind not in WITHOUT_TABLE]
    names = _names(wanted)
    origin = log.start_ns
    first = None if start_s is None else origin + round(start_s * NS_PER_S)
    last = None if end_s is None else origin + round(end_s * NS_PER_S)
    written: Counter[str] = Counter()
    with open_writer(output, force, as_rosbag2) as writer:
        for kind, topic, event in log.events_by_stream(with_truth=True):
            if isinstance(event, Transform) and event.is_static:
                # A recorder writes them again at the start of each part; with their old times a part would begin there.
                writer.write(event if first is None else replace(event, stamp_ns=max(event.stamp_ns, first)))
                continue
            if (kind, topic) not in names or (first is not None and event.stamp_ns < first):
                continue
            if last is not None and event.stamp_ns > last:
                continue
            writer.write(event, topic_of(event, names[kind, topic]))
            written[topic] += 1
        if not written and (start_s is not None or end_s is not None):
            raise ConfigError(
                f"{log.path}: no message to write between --start and --end; {output} is not made"
            )
    without_table = set() if topics else set(streams) - set(wanted)
    left_out = [
        f"{i.topic} ({i.type})"
        for i in log.streams
        if i.count and i.kind != "truth" and (not i.used or i in without_table)
    ]
    return Conversion(dict(sorted(written.items())), left_out)


def topic_of(event: Event, topic: str | None) -> str | None:
    """The topic to write an event on; None, the usual one, if the topic would change the camera of the event."""
    if isinstance(event, StereoPair):
        return None
    camera = getattr(event, "camera", None)
    return None if camera and topic is not None and camera_of(topic) != camera else topic


def _names(streams: list[StreamInfo]) -> dict[tuple[str, str], str | None]:
    """The topic under which each stream, given by kind and topic, is written; None for the usual one of its kind.

    Names that are not ROS topics are replaced by the usual one, unless two streams of a kind would meet there.
    """
    keys = {(info.kind, info.topic) for info in streams}
    counts = Counter(kind for kind, _ in keys)
    # What the rangers' servos are written on
    servos = {f"{topic}/servo" for kind, topic in keys if kind == "range"}
    return {
        (kind, topic): f"{topic}_{kind}" if topic in servos else _name(kind, topic, counts[kind] == 1)
        for kind, topic in keys
    }


def _name(kind: str, topic: str, is_only: bool) -> str | None:
    if kind == "truth":
        return TRUTH_TOPIC
    if topic.startswith("/") and topic != TRUTH_TOPIC:
        return topic
    if is_only or KINDS[kind].is_named_by_camera:
        return None
    return f"/{kind}_" + "".join(c if c.isalnum() else "_" for c in topic).strip("_").lower()
