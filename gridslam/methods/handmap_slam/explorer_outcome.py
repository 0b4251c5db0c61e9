"""What an exploration tells: the tour as a table, what was not reached and why, and a picture of it all."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gridslam.core.stamps import format_stamp
from gridslam.methods.base import Picture, Table
from gridslam.methods.handmap_slam.observation_plan import ObservationPlan, Status

COLUMNS = ("order", "x", "y", "status", "stamp", "walls", "reason")
INKS: dict[Status, tuple[int, int, int]] = {
    "reached": (30, 150, 70),
    "seen": (130, 190, 120),
    "unreachable": (220, 110, 20),
    "open": (150, 150, 150),
}
LABEL_PX = 15


def tour_table(plan: ObservationPlan) -> Table:
    """One row for each observation point in the order in which they were settled; x, y in drawing metres."""
    settled = sorted(plan.targets, key=lambda t: t.order or len(plan.targets) + 1)
    rows = []
    for target in settled:
        stamp = format_stamp(target.stamp_ns) if target.order else ""
        x, y = (round(float(v), 3) for v in target.xy)
        rows.append((target.order, x, y, target.status, stamp, int(target.walls.sum()), target.reason))
    return Table(COLUMNS, rows)


def exploration_measures(plan: ObservationPlan | None) -> dict[str, object]:
    """Counts of points by status, those not reached with their reasons, and the share of drawn walls that was looked at."""
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
        "seen_on_the_way": counts["seen"],
        "open": counts["open"],
        "unreachable": missed,
        "walls_looked_at": round(int((plan.seen & plan.coverable).sum()) / max(coverable, 1), 4),
        "walls_uncoverable": round(float(plan.uncoverable.mean()), 4) if len(plan.uncoverable) else 0.0,
    }


def tour_picture(plan: ObservationPlan | None, base: Picture, drawing_size_m: tuple[float, float]) -> Picture:
    """The picture of the drawing with map and way, and the observation points with their numbers over it."""
    height, width = base.rgb.shape[:2]
    picture = Image.fromarray(base.rgb)
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(LABEL_PX)
    for target in plan.targets if plan else ():
        x = float(target.xy[0]) / drawing_size_m[0] * width
        y = height - float(target.xy[1]) / drawing_size_m[1] * height
        ink = INKS[target.status]
        draw.ellipse((x - 5, y - 5, x + 5, y + 5), fill=ink, outline=(255, 255, 255))
        label = str(target.order) if target.order else "?"
        draw.text((x + 7, y - 7), label, fill=ink, font=font, anchor="lm")
    note = (
        "Observation points in the order in which they were settled: green reached, pale green seen on the way, "
        "orange unreachable. " + base.note
    )
    rgb: NDArray[np.uint8] = np.asarray(picture, dtype=np.uint8)
    return Picture(rgb, "Exploration", note)
