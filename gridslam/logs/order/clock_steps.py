"""Steps of the recorder's clock: where several streams jump back by the same amount at the same time.

A clock that is set back, or a recording that was played in a loop, makes every stream jump back. The streams after the
step belong together, and so do those before it. A jump back of one stream alone is disorder within that stream.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import NS_PER_S

MIN_STEP_NS = NS_PER_S // 5  # smaller ones are jitter, or cannot be distinguished from the period of a stream
_MIN_OVERLAP = 0.5  # overlap of the spans that two streams jump back over, relative to the longer
_MAX_STEPS = 1000  # largest number of steps of one stream; one with more is in disorder

Stamps = NDArray[np.int64]
Step = tuple[int, int, int]  # index of the first stamp after the step, that stamp, and the previous stamp


def clock_epochs(streams: Sequence[Stamps]) -> list[Stamps]:
    """The epoch of every event of every stream: the number of clock steps before it. `streams` are stamps in ns."""
    steps = [_steps_of(stamps) for stamps in streams]
    common = _common_steps(steps)
    return [_epochs_of(stamps, own, common) for stamps, own in zip(streams, steps, strict=True)]


def _steps_of(stamps: Stamps) -> list[Step]:
    """The jumps back of one stream."""
    places = np.flatnonzero(np.diff(stamps) < -MIN_STEP_NS) + 1
    if len(places) > _MAX_STEPS:
        return []
    return [(int(i), int(stamps[i]), int(stamps[i - 1])) for i in places]


def _common_steps(steps: Sequence[list[Step]]) -> list[Step]:
    """The steps of the stream with most of them that another stream has as well, in recorded order."""
    reference = max(steps, key=len, default=[])
    others = [own for own in steps if own is not reference]
    next_places = [0] * len(others)
    common = []
    for step in reference:
        is_common = False
        for number, own in enumerate(others):
            place = next((k for k in range(next_places[number], len(own)) if _overlap(own[k], step)), None)
            if place is not None:
                next_places[number] = place + 1
                is_common = True
        if is_common:
            common.append(step)
    return common


def _epochs_of(stamps: Stamps, own: list[Step], common: list[Step]) -> Stamps:
    """The epochs of one stream.

    A stream that is too slow to show a common step is in the next epoch from its first stamp on that is later than
    all stamps before the step.
    """
    epochs = np.zeros(len(stamps), dtype=np.int64)
    start, next_own = 0, 0
    for number, step in enumerate(common, start=1):
        shown = next((k for k in range(next_own, len(own)) if _overlap(own[k], step)), None)
        if shown is not None:
            start, next_own = own[shown][0], shown + 1
        else:
            later = np.flatnonzero(stamps[start:] > step[2] + MIN_STEP_NS)
            start = start + int(later[0]) if len(later) else len(stamps)
        epochs[start:] = number
    return epochs


def _overlap(a: Step, b: Step) -> bool:
    """Whether two streams jump back over the same span of time."""
    common = min(a[2], b[2]) - max(a[1], b[1])
    return common >= _MIN_OVERLAP * max(a[2] - a[1], b[2] - b[1])
