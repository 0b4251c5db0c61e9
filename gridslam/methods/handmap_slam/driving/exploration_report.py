"""Results of an exploration: the tour as a table, measures, and a picture."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gridslam.core.stamps import format_stamp
from gridslam.methods.base import Picture, Table
from gridslam.methods.handmap_slam.driving.observation_plan import ObservationPlan, Status

COLUMNS = ("order", "x", "y", "status", "stamp", "walls", "reason")
COLOURS: dict[Status, tuple[int, int, int]] = {
    "reached": (30, 150, 70),
    "seen": (130, 190, 120),
    "unreachable": (220, 110, 20),
    "open": (150, 150, 150),
}
LABEL_PX = 15
DOT_PX, LABEL_OFFSET_PX = 5, 7


def tour_table(plan: ObservationPlan) -> Table:
    """One row per observation point, in the order in which they were settled; x, y in drawing units."""
    in_order = sorted(plan.targets, key=lambda t: t.order or len(plan.targets) + 1)
    rows = []
    for target in in_order:
        stamp = format_stamp(target.stamp_ns) if target.order else ""
        x, y = (round(float(v), 3) for v in target.xy)
        rows.append((target.order, x, y, target.status, stamp, int(target.walls.sum()), target.reason))
    return Table(COLUMNS, rows)


def exploration_measures(plan: ObservationPlan | None) -> dict[str, object]:
    """Counts of points by status, the unreachable ones with reasons, and the fraction of drawn walls observed."""
    if plan is None:
        return {"points": 0, "unreachable": []}
    counts = Counter(target.status for target in plan.targets)
    missed = [
        {"x": round(float(t.xy[0]), 3), "y": round(float(t.xy[1]), 3), "reason": t.reason}
        for t in plan.targets
        if t.status == "unreachable"
    ]
    coverable = int(plan.coverable.sum())
    return {
        "points": len(plan.targets),
        "reached": counts["reached"],
        "observed_in_passing": counts["seen"],
        "open": counts["open"],
        "unreachable": missed,
        "walls_observed": round(int((plan.seen & plan.coverable).sum()) / max(coverable, 1), 4),
        "walls_uncoverable": round(float(plan.uncoverable.mean()), 4) if len(plan.uncoverable) else 0.0,
    }


def tour_picture(plan: ObservationPlan | None, base: Picture, drawing_size: tuple[float, float]) -> Picture:
    """The picture of the drawing with map and path, overlaid with the numbered observation points."""
    height, width = base.rgb.shape[:2]
    picture = Image.fromarray(base.rgb)
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(LABEL_PX)
    for target in plan.targets if plan else ():
        x = float(target.xy[0]) / drawing_size[0] * width
        y = height - float(target.xy[1]) / drawing_size[1] * height
        colour = COLOURS[target.status]
        draw.ellipse((x - DOT_PX, y - DOT_PX, x + DOT_PX, y + DOT_PX), fill=colour, outline=(255, 255, 255))
        label = str(target.order) if target.order else "?"
        draw.text((x + LABEL_OFFSET_PX, y - LABEL_OFFSET_PX), label, fill=colour, font=font, anchor="lm")
    note = (
        "Observation points in the order in which they were settled: green reached, pale green observed in passing, "
        "orange unreachable. " + base.note
    )
    rgb: NDArray[np.uint8] = np.asarray(picture, dtype=np.uint8)
    return Picture(rgb, "Exploration", note)
