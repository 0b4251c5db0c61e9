"""The few measures that people look at first, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gridslam.evaluation.gates import measures_of

MAX_ROWS = 10
UNITS: Mapping[str, str] = {
    "ape.trans": "m", "ape.rot": "deg", "rpe.trans": "m", "rpe.rot": "deg", "relations.trans": "m",
    "relations.rot": "deg", "map.accuracy": "m", "map.completeness": "m", "objects.position": "m",
    "objects.heading": "deg", "final.trans": "m", "final.rot": "deg", "localization.time_to_convergence": "s",
    "kitti.t_rel": "%", "kitti.r_rel": "deg/100 m", "ape.alignment.x": "m", "ape.alignment.y": "m",
    "ape.alignment.yaw": "rad", "map.alignment.x": "m", "map.alignment.y": "m", "map.alignment.yaw": "rad",
}  # fmt: skip
# In order of importance; the first MAX_ROWS that a document has are shown.
IMPORTANT = (
    "ape.trans.rmse", "ape.trans.max", "ape.rot.rmse", "localization.success", "localization.time_to_convergence",
    "relations.trans.mean", "relations.rot.mean", "map.accuracy.mean", "map.accuracy.p95", "map.completeness.mean",
    "map.iou", "objects.correct", "doors.state_correct", "kitti.t_rel", "kitti.r_rel", "final.trans",
    "rpe.trans.rmse", "rpe.rot.rmse", "ape.count", "ape.alignment.kind", "map.log_loss", "map.alignment.kind",
)  # fmt: skip
ORDER = (
    "ape.count", "ape.alignment.kind", "ape.trans.rmse", "ape.trans.max", "ape.rot.rmse", "rpe.trans.rmse", "rpe.rot.rmse",
    "final.trans", "kitti.t_rel", "kitti.r_rel", "localization.success", "localization.time_to_convergence",
    "relations.trans.mean", "relations.rot.mean", "map.alignment.kind", "map.accuracy.mean", "map.accuracy.p95",
    "map.completeness.mean", "map.iou", "map.log_loss", "objects.correct", "doors.state_correct",
)  # fmt: skip


def headline(document: Mapping[str, Any]) -> list[str]:
    """The dotted keys of at most MAX_ROWS measures of a document, in the order in which they are shown."""
    present = measures_of(document)
    chosen = [key for key in IMPORTANT if key in present][:MAX_ROWS]
    return [key for key in ORDER if key in chosen]


def unit_of(key: str) -> str:
    """The unit of a measure; empty without one."""
    if key.endswith(".var"):
        return "m^2"
    if key.endswith((".count", ".kind")):
        return ""
    return UNITS.get(key) or UNITS.get(key.rpartition(".")[0], "")


def text_of(value: object, digits: int = 6) -> str:
    """A value as text: numbers with `digits` significant digits, `-` without a value."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.{digits}g}"
    return "-" if value is None else str(value)
