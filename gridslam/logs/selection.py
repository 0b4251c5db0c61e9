"""Which stream serves as what: by type where there is one, by config where there are several."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gridslam.core.errors import ConfigError, LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.stereo import side_of
from gridslam.logs.streams import KINDS, SILENT, SINGLE, RecordedStream

if TYPE_CHECKING:
    from gridslam.logs.log import Log

_ROBOT_FRAMES = ("base_link", "base_footprint")
TRUTH_TOPIC = "/ground_truth"  # where simulators and motion capture publish the true pose
_TRUTH_KINDS = frozenset({"odom", "pose", "fix", "truth"})


@dataclass(frozen=True, slots=True)
class Choice:
    """`kind_of`: the streams to deliver, by index, with what each serves as, in order of precedence."""

    kind_of: dict[int, str]
    truth: int | None
    base_frame: str
    listed: list[int]


def choose(
    streams: Sequence[RecordedStream],
    config: LogConfig,
    kinds: Collection[str] | None,
    base_frame: str | None,
) -> Choice:
    """Match the wanted kinds with the streams.

    With `kinds` None everything is delivered and nothing has to be unique. Otherwise two candidates for a
    single stream, or a configured topic that the log lacks, are a ConfigError that lists the choices.
    """
    listed = sorted(range(len(streams)), key=lambda i: _precedence(streams[i]))
    truth = _truth(streams, listed, config)
    kind_of: dict[int, str] = {}
    for kind in KINDS:
        if kind in SILENT or (kinds is not None and kind not in kinds):
            continue
        recorded = "image" if kind == "stereo" else kind
        candidates = [i for i in listed if i not in (truth, *kind_of) and streams[i].kind == recorded]
        if kind == "stereo":
            candidates = [i for i in candidates if kinds is not None and _is_sided(streams[i])]
        named = config.topics.get(kind)  # type: ignore[call-overload]
        if named is not None:
            candidates = _named(
                kind, [named] if isinstance(named, str) else named, candidates, streams, listed
            )
        elif kinds is not None and kind in SINGLE and len(candidates) > 1:
            raise ConfigError(_ambiguous(kind, [streams[i] for i in candidates]))
        if kind == "odom" and not candidates and kinds is not None:
            candidates = _odometry_from_tf(streams, listed, config.base_frame or base_frame)
        kind_of.update(dict.fromkeys(candidates, kind))
    base = config.base_frame or base_frame or _base_of(streams, kind_of, listed)
    return Choice(_by_precedence(kind_of, streams), truth, base, listed)


def require_streams(log: Log, needs: Collection[str]) -> None:
    """Raise a LogError unless the log delivers every kind in `needs`; it lists what the log has.

    A need may name several kinds of which one will do: "scan|depth".
    """
    have = {info.kind for info in log.streams if info.used and info.count}
    for need in needs:
        kinds = need.split("|")
        if have.isdisjoint(kinds):
            found = ", ".join(f"{i.label} ({i.type}, {i.count})" for i in log.streams if i.count) or "nothing"
            raise LogError(
                f"{log.path}: no {' or '.join(kinds)} stream, which the method needs. The log has: {found}. "
                f"If one of these is it, say so in the config: log: {{topics: {{{kinds[0]}: TOPIC}}}}"
            )


def _is_sided(stream: RecordedStream) -> bool:
    """Whether a stream of images belongs to a stereo head."""
    return bool(side_of((stream.topic,)) or any(side_of((frame,)) for frame in stream.frames))


def _precedence(stream: RecordedStream) -> tuple[int, str, str]:
    return KINDS.index(stream.kind), stream.topic, stream.detail


def _by_precedence(kind_of: dict[int, str], streams: Sequence[RecordedStream]) -> dict[int, str]:
    order = sorted(kind_of, key=lambda i: (KINDS.index(kind_of[i]), *_precedence(streams[i])[1:]))
    return {i: kind_of[i] for i in order}


def _truth(streams: Sequence[RecordedStream], listed: Sequence[int], config: LogConfig) -> int | None:
    """The stream of the true pose: named by config, or marked as such by its format."""
    fitting = [i for i in listed if streams[i].kind in _TRUTH_KINDS]
    for index in fitting:
        if streams[index].topic == (config.truth or TRUTH_TOPIC) or streams[index].kind == "truth":
            return index
    if config.truth is not None:
        has = ", ".join(streams[i].topic for i in fitting) or "no stream of poses"
        raise ConfigError(f"log.truth: the log has no poses on {config.truth!r}; it has {has}")
    return None


def _named(
    kind: str,
    topics: Sequence[str],
    candidates: Sequence[int],
    streams: Sequence[RecordedStream],
    listed: Sequence[int],
) -> list[int]:
    """The candidates on the configured topics; odometry may be a tf stream, named `parent->child`."""
    chosen = []
    pool = [*candidates, *(i for i in listed if kind == "odom" and streams[i].kind == "tf")]
    for topic in topics:
        matches = [i for i in pool if topic in (streams[i].topic, streams[i].detail, streams[i].label)]
        if not matches:
            has = ", ".join(streams[i].label for i in pool) or "none"
            raise ConfigError(f"log.topics.{kind}: the log has no {kind} stream {topic!r}; it has: {has}")
        chosen += matches
    if kind in SINGLE and len(chosen) > 1:
        raise ConfigError(_ambiguous(kind, [streams[i] for i in chosen]))
    return chosen


def _ambiguous(kind: str, candidates: Sequence[RecordedStream]) -> str:
    listing = ", ".join(f"{s.label} ({s.type}, {len(s.stamps_ns)} messages)" for s in candidates)
    return (
        f"log.topics.{kind}: the log has {len(candidates)} {kind} streams: {listing}. "
        f"Choose one in the config: log: {{topics: {{{kind}: {candidates[0].topic}}}}}"
    )


def _odometry_from_tf(
    streams: Sequence[RecordedStream], listed: Sequence[int], base_frame: str | None
) -> list[int]:
    """tf streams that say odom->base, for a log without odometry messages."""
    robots = (base_frame,) if base_frame else _ROBOT_FRAMES
    found = [
        i
        for i in listed
        if streams[i].kind == "tf"
        and streams[i].child_frame in robots
        and "odom" in streams[i].detail.split("->")[0]
    ]
    if len(found) > 1:
        raise ConfigError(_ambiguous("odom", [streams[i] for i in found]).replace("/tf}}", "PARENT->CHILD}}"))
    return found


def _base_of(streams: Sequence[RecordedStream], kind_of: dict[int, str], listed: Sequence[int]) -> str:
    """The frame that odometry moves; base_link in a log without odometry."""
    for index, kind in kind_of.items():
        if kind == "odom" and streams[index].child_frame:
            return streams[index].child_frame
    for index in listed:
        if streams[index].kind == "odom" and streams[index].child_frame:
            return streams[index].child_frame
    return "base_link"
