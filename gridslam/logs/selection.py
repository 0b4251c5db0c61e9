"""Selects the stream of each kind: by its type where there is one, by the config where there are several."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from gridslam.core.cameras import side_of
from gridslam.core.errors import ConfigError
from gridslam.logs.config import LogConfig
from gridslam.logs.kinds import EVENT_KINDS, KINDS, PRECEDENCE, TRUTH_TOPIC
from gridslam.logs.stereo import is_rectified
from gridslam.logs.streams import RecordedStream

_ROBOT_FRAMES = ("base_link", "base_footprint")


@dataclass(frozen=True, slots=True)
class StreamSelection:
    """The streams that are read.

    `kind_of` gives, by index of the stream, the kind that it serves as, in order of precedence. `truth` is the index
    of the true poses, `listed` all indices in the order in which they are shown.
    """

    kind_of: dict[int, str]
    truth: int | None
    base_frame: str
    listed: list[int]


def select_streams(
    streams: Sequence[RecordedStream],
    config: LogConfig,
    kinds: Collection[str] | None,
    base_frame: str | None,
) -> StreamSelection:
    """Select the streams of the wanted kinds; with `kinds` None, all streams.

    Raises ConfigError, which lists the candidates: two streams of a kind of which a method takes one (with `kinds`
    None several are fine; so are several lidars with frames of their own), or a configured topic that the log lacks.
    """
    listed = sorted(range(len(streams)), key=lambda i: _precedence(streams[i]))
    truth = _truth(streams, listed, config)
    kind_of: dict[int, str] = {}
    for kind in EVENT_KINDS:
        if kinds is not None and kind not in kinds:
            continue
        recorded = "image" if kind == "stereo" else kind
        candidates = [i for i in listed if streams[i].kind == recorded and i != truth and i not in kind_of]
        if kind == "stereo":
            candidates = [i for i in candidates if kinds is not None and _is_sided(streams[i])]
        if kind == "scan" and kinds is not None:
            clouds = [i for i in listed if streams[i].kind == "cloud" and len(streams[i].stamps_ns)]
            candidates += clouds if not candidates or kind in config.topics else []
        named = config.topics.get(kind)
        if named is not None:
            candidates = _named(
                kind, [named] if isinstance(named, str) else named, candidates, streams, listed
            )
        elif kind == "stereo":
            candidates = _one_form(candidates, streams)
        elif kinds is not None and len(candidates) > 1:
            candidates = _of_one_kind(kind, candidates, streams)
        kind_of.update(dict.fromkeys(candidates, kind))
    if kinds is not None and "odom" in kinds and "odom" not in {*kind_of.values(), *config.topics}:
        from_tf = _odometry_from_tf(streams, listed, config.base_frame or base_frame, kind_of)
        kind_of.update(dict.fromkeys(from_tf, "odom"))
    base = config.base_frame or base_frame or _base_of(streams, kind_of, listed)
    return StreamSelection(_by_precedence(kind_of, streams), truth, base, listed)


def _is_sided(stream: RecordedStream) -> bool:
    """Whether a stream of images belongs to a stereo head."""
    return bool(side_of((stream.topic,)) or any(side_of((frame,)) for frame in stream.frames))


def _one_form(candidates: list[int], streams: Sequence[RecordedStream]) -> list[int]:
    """The stereo streams in one form only, where a log has several: rectified before raw, plain before compressed."""
    forms: tuple[Callable[[RecordedStream], bool], ...] = (
        lambda stream: is_rectified(stream.topic),
        lambda stream: not stream.topic.endswith(("/compressed", "/theora", "/compressedDepth")),
    )
    for is_preferred in forms:
        preferred = [i for i in candidates if is_preferred(streams[i])]
        if {side_of((streams[i].topic, *streams[i].frames)) for i in preferred} == {"left", "right"}:
            candidates = preferred
    return candidates


def _precedence(stream: RecordedStream) -> tuple[int, str, str]:
    return PRECEDENCE[stream.kind], stream.topic, stream.detail


def _by_precedence(kind_of: dict[int, str], streams: Sequence[RecordedStream]) -> dict[int, str]:
    order = sorted(kind_of, key=lambda i: (PRECEDENCE[kind_of[i]], *_precedence(streams[i])[1:]))
    return {i: kind_of[i] for i in order}


def _truth(streams: Sequence[RecordedStream], listed: Sequence[int], config: LogConfig) -> int | None:
    """The stream of the true pose: named by config, or marked as such by its format."""
    candidates = [i for i in listed if KINDS[streams[i].kind].may_be_truth]
    for index in candidates:
        if streams[index].topic == (config.truth or TRUTH_TOPIC) or streams[index].kind == "truth":
            return index
    if config.truth is not None:
        has = ", ".join(streams[i].topic for i in candidates) or "no stream of poses"
        raise ConfigError(f"log.truth: the log has no poses on {config.truth!r}; it has {has}")
    return None


def _named(
    kind: str,
    topics: Sequence[str],
    candidates: Sequence[int],
    streams: Sequence[RecordedStream],
    listed: Sequence[int],
) -> list[int]:
    """The candidates on the configured topics; for odometry also a tf stream, named `parent->child`."""
    chosen = []
    pool = [*candidates, *(i for i in listed if kind == "odom" and streams[i].kind == "tf")]
    for topic in topics:
        matches = [i for i in pool if topic in (streams[i].topic, streams[i].detail, streams[i].label)]
        if not matches:
            has = ", ".join(streams[i].label for i in pool) or "none"
            raise ConfigError(f"log.topics.{kind}: the log has no {kind} stream {topic!r}; it has: {has}")
        chosen += matches
    return _of_one_kind(kind, chosen, streams) if len(chosen) > 1 else chosen


def _of_one_kind(kind: str, candidates: list[int], streams: Sequence[RecordedStream]) -> list[int]:
    """Those of several streams of a kind that a method gets: all lidars, where each has a frame of its own, and the densest IMU.

    Raises ConfigError: the kind is one of which a method takes one.
    """
    several = KINDS[kind].several
    if several == "all":
        return candidates
    used = [i for i in candidates if len(streams[i].stamps_ns)]
    frames = [frame for i in used for frame in streams[i].frames]
    if several == "of_own_frames" and used and len(set(frames)) == len(frames):
        return used
    if several == "densest":
        return [max(candidates, key=lambda i: len(streams[i].stamps_ns))]
    raise ConfigError(_ambiguous(kind, [streams[i] for i in candidates]))


def _ambiguous(kind: str, candidates: Sequence[RecordedStream]) -> str:
    listing = ", ".join(f"{s.label} ({s.type}, {len(s.stamps_ns)} messages)" for s in candidates)
    return (
        f"log.topics.{kind}: the log has {len(candidates)} {kind} streams: {listing}. "
        f"Choose one in the config: log: {{topics: {{{kind}: {candidates[0].topic}}}}}"
    )


def _odometry_from_tf(
    streams: Sequence[RecordedStream], listed: Sequence[int], base_frame: str | None, kind_of: dict[int, str]
) -> list[int]:
    """The tf streams of odom->base, for a log without odometry messages; of several robots the one whose scans are used.

    Of two frames of one robot base_link is taken.
    """
    robots = (base_frame,) if base_frame else _ROBOT_FRAMES
    found = [
        i
        for i in listed
        if streams[i].kind == "tf"
        and (streams[i].child_frame in robots or streams[i].child_frame.rsplit("/", 1)[-1] in robots)
        and "odom" in streams[i].detail.split("->")[0]
    ]
    if len(found) > 1:
        sensors = {_namespace(f) for i, kind in kind_of.items() if kind != "tf" for f in streams[i].frames}
        of_sensors = [i for i in found if sensors == {_namespace(streams[i].child_frame)}]
        found = of_sensors or found
    robots_of = {(streams[i].detail.split("->")[0], _namespace(streams[i].child_frame)) for i in found}
    if len(found) > 1 and len(robots_of) == 1:  # two frames of one robot
        found = [min(found, key=lambda i: streams[i].child_frame.rsplit("/", 1)[-1] != _ROBOT_FRAMES[0])]
    if len(found) > 1:
        choice = streams[found[0]].detail
        raise ConfigError(
            _ambiguous("odom", [streams[i] for i in found]).replace("odom: /tf}}", f'odom: "{choice}"}}}}')
        )
    return found


def _namespace(frame: str) -> str:
    """The robot's name before a frame's own: `robot1` of `robot1/laser`; empty where there is none."""
    return frame.rpartition("/")[0]


def _base_of(streams: Sequence[RecordedStream], kind_of: dict[int, str], listed: Sequence[int]) -> str:
    """The frame that odometry moves; base_link in a log without odometry."""
    for index, kind in kind_of.items():
        if kind == "odom" and streams[index].child_frame:
            return streams[index].child_frame
    for index in listed:
        if streams[index].kind == "odom" and streams[index].child_frame:
            return streams[index].child_frame
    return "base_link"
