"""Notes on the order of a log's messages: clock steps, out-of-order and repeated stamps, unused streams."""

from __future__ import annotations

from collections.abc import Sequence

from gridslam.logs.kinds import KINDS
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order import ordering
from gridslam.logs.order.clock_steps import clock_epochs
from gridslam.logs.selection import StreamSelection
from gridslam.logs.streams import RecordedStream


def note_disorder(
    streams: Sequence[RecordedStream],
    selection: StreamSelection,
    is_sorted: bool,
    message_counts: MessageCounts,
) -> None:
    """Count stamps out of order, equal stamps, steps of the clock, and events of streams that are not used."""
    if not is_sorted:
        _note_clock_jumps(streams, selection, message_counts)
    for index, kind in selection.kind_of.items():
        stamps = streams[index].stamps_ns
        if count := ordering.out_of_order_stamps(stamps):
            message_counts.count(f"out_of_order.{kind}", count)
            message_counts.note(_disorder_note(streams[index], count, is_sorted))
        if equal := ordering.repeated_stamps(stamps):
            message_counts.count(f"equal_stamps.{kind}", equal)
    for index in selection.listed:
        stream = streams[index]
        is_used = index in selection.kind_of or index == selection.truth
        if not is_used and KINDS[stream.kind].is_event and stream.stamps_ns:
            message_counts.count(f"unused.{stream.kind}", len(stream.stamps_ns))


def _note_clock_jumps(
    streams: Sequence[RecordedStream], selection: StreamSelection, message_counts: MessageCounts
) -> None:
    epochs = clock_epochs([ordering.without_outliers(streams[i].stamps_ns) for i in selection.kind_of])
    if jumps := max((int(e[-1]) for e in epochs if len(e)), default=0):
        message_counts.count("clock_jumps", jumps)
        message_counts.find(
            f"the clock was set back {jumps} times, or the recording played in a loop: streams stay together in "
            "recorded order"
        )


def _disorder_note(stream: RecordedStream, count: int, is_sorted: bool) -> str:
    what = "are sorted" if is_sorted else "keep their recorded place; log.order: stamp would sort them"
    return f"{stream.label}: {count} out-of-order stamps; the messages {what}"
