"""gridslam info"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import console
from ..completion import complete_config
from ..options import AsJson, EndTime, LogPath, StartTime, Strict, reading_config

if TYPE_CHECKING:
    from gridslam.logs.log import Log
    from gridslam.methods.registry import MethodEntry

LOSSY = 3
PEEKED_EVENTS = 2000  # are looked at without --check: what is wrong from the start shows in them
SERVES_AS = {"cloud": "scan", "image": "stereo"}  # what methods take streams of a kind as
MAX_ROWS = 60
MAX_PROBLEMS = 60
Check = Annotated[
    bool,
    typer.Option(
        "--check", help="Also look at the content of every message, and count those that can be used."
    ),
]
Layout = Annotated[
    Path | None,
    typer.Option(
        "--layout",
        metavar="YAML",
        readable=False,
        help="How to read a folder of CSV files that has no log.yaml.",
    ),
]

MethodConfig = Annotated[
    str | None,
    typer.Option(
        "--config",
        "-c",
        metavar="CONFIG",
        autocompletion=complete_config,
        help="Show what a run with this config would use of the log.",
    ),
]


def run(
    log: LogPath,
    config: MethodConfig = None,
    layout: Layout = None,
    start: StartTime = None,
    end: EndTime = None,
    check: Check = False,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Show what a log holds: its streams, how long it is, and what is wrong with it.

    The table has a line for each stream. "stream" is its kind, by which methods ask for it ("truth" is what results are
    measured by, "other" what no method reads), "topic" its name in the log (of a transform also parent->child), "type" the
    type of its messages, "messages" their number, "rate Hz" their average number per second, "frame" their frame_id, and "out
    of order" the number of stamps that are smaller than the one before.

    A second table shows the extrinsics: "sensor" is the sensor's frame, "on" the frame that it is mounted on, "yaw deg" its
    yaw about z.

    Notes on stderr name what cannot be used and what had to be assumed. With -c, the column "used" says which streams a run would
    take, and notes are those of the run; a log that lacks what the method needs is an error. With --start or --end, messages
    are those between the two.
    """
    from gridslam.logs.open import open_log
    from gridslam.logs.requirements import require_streams

    method = _method_of(config)
    with open_log(
        log, reading_config(config, layout, start, end), None if method is None else method.reads
    ) as opened:
        if method is not None:
            require_streams(opened, method.needs)
        if check:
            _look_at(opened.events_by_stream(with_truth=True))
        document = describe(opened)
        if method is not None:
            document |= _use(opened, method)
        else:
            _add_remarks_of_a_run(document, opened, None if check else PEEKED_EVENTS)
    if as_json:
        console.emit_json(document)
    else:
        _show(document)
    if strict and (document["is_lossy"] or document["has_findings"]):
        console.complain(f"error: {log}: not all of the log can be used as recorded, which --strict forbids")
        raise typer.Exit(LOSSY)


def _method_of(config: str | None) -> MethodEntry | None:
    """The method of a config."""
    if config is None:
        return None
    from gridslam.methods.registry import METHODS
    from gridslam.runs.run_config import load_config

    return METHODS[load_config(config).method_name]


def _look_at(events: Iterable[object], count: int | None = None) -> None:
    """Read all events of a log, or the first ones, so that its notes say what is wrong with them."""
    for _ in islice(events, count):
        pass


def _add_remarks_of_a_run(document: dict[str, Any], log: Log, events: int | None) -> None:
    """Add to the document what a run of the first method that the log suits would say about as many of its first events."""
    from gridslam.core.errors import GridslamError
    from gridslam.methods.registry import BUILT_IN

    present = {SERVES_AS.get(i.kind, i.kind) for i in log.streams if i.count} | {"tf"}
    suited = (m for m in BUILT_IN.values() if all(present & set(need.split("|")) for need in m.needs))
    method = next(suited, None)
    if method is None:
        return
    try:
        as_read = log.as_read_for(method.reads)
        _look_at(as_read.events(), events)
    except GridslamError as error:
        document["problems"] = [*document["problems"], f"a run would end with this: {error}"]
        return
    known = set(document["problems"])
    new = [line for line in as_read.problems if line not in known]
    document["problems"] = [*document["problems"], *new]
    document["has_findings"] |= as_read.has_findings


def _use(log: Log, method: MethodEntry) -> dict[str, Any]:
    """The streams of the log that a run of the method uses, and the kinds that it would use but the log lacks; for JSON."""
    used = [info for info in log.streams if info.used and info.count]
    present = {info.kind for info in used}
    missing = [kind for kind in method.uses if kind not in present]
    motion = _motion_by(present) if "scan" in method.needs and "imu" in method.uses else None
    return {
        "used": [f"{info.kind} {info.label}" for info in used],
        "missing": missing,
        "motion": motion,
    }


def _motion_by(present: Collection[str]) -> str:
    """The prediction of the motion between scans, in words, given the kinds of the streams that are used."""
    if "odom" in present:
        return "odometry, once it agrees with the first scans; the scans decide"
    if "imu" in present:
        return "constant velocity and the IMU's turn rate, while that agrees with the scans; the scans decide"
    return "constant velocity; the scans decide"


def describe(log: Log) -> dict[str, Any]:
    """The log as one JSON document. Stamps are decimal text in seconds, exact to the nanosecond."""
    from gridslam.core.stamps import format_stamp

    shown = log.streams_in_span() if log.has_span else log.streams
    starts = [i.first_stamp_ns for i in shown if i.first_stamp_ns is not None]
    ends = [i.last_stamp_ns for i in shown if i.last_stamp_ns is not None]
    streams = [
        {
            "kind": i.kind,
            "topic": i.topic,
            "detail": i.detail,
            "type": i.type,
            "count": i.count,
            "first": None if i.first_stamp_ns is None else format_stamp(i.first_stamp_ns),
            "last": None if i.last_stamp_ns is None else format_stamp(i.last_stamp_ns),
            "frame": i.frame,
            "out_of_order": i.out_of_order,
            "used": i.used,
        }
        for i in shown
    ]
    return {
        "path": str(log.path),
        "format": log.format,
        "compression": log.compression,
        "start": format_stamp(min(starts)) if starts else None,
        "duration_s": (max(ends) - min(starts)) / 1e9 if starts else 0.0,
        "base_frame": log.base_frame,
        "streams": streams,
        "extrinsics": [
            {
                "parent": t.frame_id,
                "frame": t.child_frame_id,
                "translation_m": t.translation_m,
                "quat_wxyz": t.quat_wxyz,
            }
            for t in log.sensor_extrinsics
        ],
        "counters": log.counters,
        "problems": log.problems,
        "is_lossy": log.is_lossy,
        "has_findings": log.has_findings,
    }


def _show(document: dict[str, Any]) -> None:
    """The document as text."""
    facts = [
        ("log", document["path"]),
        ("format", f"{document['format']}, compression {document['compression']}"),
        ("start", document["start"] or "-"),
        ("duration", f"{document['duration_s']:.3f} s"),
        ("base frame", document["base_frame"]),
    ]
    console.emit_table(("", ""), facts)
    heads: tuple[str, ...] = ("stream", "topic", "type", "messages", "rate Hz", "frame", "out of order")
    rows = [_row(stream) for stream in document["streams"]]
    if "missing" in document:
        heads = (*heads, "used")
        rows = [
            (*row, "yes" if stream["used"] else "no")
            for row, stream in zip(rows, document["streams"], strict=True)
        ]
    console.emit("")
    console.emit_table(heads, rows[:MAX_ROWS])
    if document.get("missing"):
        console.emit(f"not in the log, and the method does without: {', '.join(document['missing'])}")
    if document.get("motion"):
        console.emit(f"motion between scans is predicted by: {document['motion']}")
    if len(rows) > MAX_ROWS:
        console.emit(f"and {len(rows) - MAX_ROWS} more; --json shows all")
    if document["extrinsics"]:
        console.emit("")
        console.emit_table(
            ("sensor", "on", "x m", "y m", "z m", "yaw deg"),
            [_extrinsics(m) for m in document["extrinsics"][:MAX_ROWS]],
        )
    if len(document["extrinsics"]) > MAX_ROWS:
        console.emit(f"and {len(document['extrinsics']) - MAX_ROWS} more; --json shows all")
    for problem in document["problems"][:MAX_PROBLEMS]:
        console.say(f"note: {problem}")
    if len(document["problems"]) > MAX_PROBLEMS:
        console.say(f"note: and {len(document['problems']) - MAX_PROBLEMS} more; --json shows all")


def _row(stream: dict[str, Any]) -> tuple[object, ...]:
    from gridslam.core.stamps import NS_PER_S, parse_stamp

    rate = "-"
    first, last = (parse_stamp(stream[key] or "") for key in ("first", "last"))
    if first is not None and last is not None and first < last:
        rate = f"{(stream['count'] - 1) * NS_PER_S / (last - first):.1f}"
    topic = f"{stream['topic']} ({stream['detail']})" if stream["detail"] else stream["topic"]
    return (
        stream["kind"],
        topic,
        stream["type"],
        stream["count"],
        rate,
        stream["frame"],
        stream["out_of_order"],
    )


def _extrinsics(extrinsics: dict[str, Any]) -> tuple[object, ...]:
    import math

    from gridslam.logs.rotations import yaw_of

    x, y, z = (f"{v:.3f}" for v in extrinsics["translation_m"])
    yaw = math.degrees(yaw_of(tuple(extrinsics["quat_wxyz"])))
    return extrinsics["frame"], extrinsics["parent"], x, y, z, f"{yaw:.2f}"
