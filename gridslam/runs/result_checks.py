"""Checks of a finished run: empty results are refused, and streams of which no message was used are reported."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import islice
from pathlib import Path

from gridslam.core.errors import MethodError
from gridslam.methods.base import RunResult
from gridslam.runs.run_counts import Counts

MAX_REASONS, MAX_WHERE = 4, 160  # largest number of reasons in an error message, and of characters of a place
ADVICE = {
    "no_partner": "the pictures of a pair must be of one size and at most 5 ms apart: synchronise the cameras",
    "unknown_encoding": "record the pictures in an encoding of the page on formats",
    "bad_angles": "angle_min, angle_max and angle_increment must give the beams' angles in radians",
    "bad_range_limits": "range_max must be above range_min",
    "no_coordinates": "the clouds need the fields x, y and z",
}


def refuse_empty_result(
    method: str, log_path: Path, result: RunResult, counts: Counts, problems: Sequence[str] = ()
) -> None:
    """Raises MethodError: the result has no pose, or a map without cells.

    The message names the commonest skip reasons, the first skipped message, which is found in the `problems` of the log, and
    what to do.
    """
    is_empty_map = result.occupancy is not None and not result.occupancy.probability.size
    if len(result.trajectory) and not is_empty_map:
        return
    lacking = "a map without cells" if len(result.trajectory) else "no pose"
    reasons = _reasons(counts)
    why = f"skipped: {reasons}" if reasons else "none of its messages could be used"
    places = (line.partition(", first at ")[2] for line in problems if line.startswith("skipped"))
    why += "".join(f"; first at {place[:MAX_WHERE]}" for place in islice(places, 1))
    why += "".join(f"; {advice}" for reason, advice in ADVICE.items() if f".{reason}" in reasons)
    raise MethodError(
        f"{log_path}: {method} found {lacking} ({why}); `gridslam info` shows the streams of the log"
    )


def unused_streams(counts: Counts) -> list[str]:
    """Names of the streams that the method reads, if every message of them was skipped."""
    return [
        name
        for name, stream in counts.streams.items()
        if name != "truth" and stream.read and not stream.used and _reasons(counts, f"{name}.")
    ]


def unused_stream_line(name: str, counts: Counts, missing_inputs: Collection[str]) -> str:
    """The line about an unused stream. If an input file of the same name is missing, the line asks for it."""
    line = (
        f"none of the {counts.streams[name].read} {name} messages was used ({_reasons(counts, f'{name}.')})"
    )
    return f"{line}; add --{name} FILE" if name in missing_inputs else line


def _reasons(counts: Counts, prefix: str = "") -> str:
    """The commonest skip reasons whose keys begin with `prefix`, with their numbers."""
    ranked = sorted(counts.skipped_by_reason.items(), key=lambda item: (-item[1], item[0]))
    named = [(reason.removeprefix(prefix), n) for reason, n in ranked if n and reason.startswith(prefix)]
    return ", ".join(f"{number} x {reason}" for reason, number in named[:MAX_REASONS])
