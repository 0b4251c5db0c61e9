"""Success of a localization, and its time to convergence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.evaluation.pose_errors import PoseErrors


@dataclass(frozen=True, slots=True)
class Localization:
    """Success, and the time from the first pose to the first pose of the successful rest; NaN without success."""

    success: bool
    time_to_convergence_s: float


def judge_localization(
    stamps_ns: NDArray[np.int64],
    errors: PoseErrors,
    start_ns: int,
    max_translation_m: float = 0.5,
    max_rotation_deg: float = 10.0,
) -> Localization:
    """Judge a localization: it succeeds if both errors are below their bounds from some pose until the end.

    `stamps_ns` `(n,)` are the ascending stamps of the errors, `start_ns` the stamp of the trajectory's first pose.
    """
    is_correct = (errors.translation_m < max_translation_m) & (errors.rotation_deg < max_rotation_deg)
    if not len(is_correct) or not is_correct[-1]:
        return Localization(False, float("nan"))
    wrong = np.flatnonzero(~is_correct)
    first = int(wrong[-1]) + 1 if len(wrong) else 0
    return Localization(True, (int(stamps_ns[first]) - start_ns) / 1e9)
