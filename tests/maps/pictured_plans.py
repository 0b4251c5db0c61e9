"""Plans of buildings by seed, and pictures of them as people make them: pens, scans, photographs of a sheet on a table.

`python -m tests.maps.pictured_plans [FIRST [COUNT]]` prints how well each kind of picture is read (seeds 0 to 19 by default).
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import MapError
from gridslam.maps.drawings.drawing import drawn_map, load_drawing

Pixels = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHEET = (640, 900)  # rows, columns
MARGIN = 70
DOOR = 40
MIN_ROOM = 110


@dataclass(frozen=True)
class Plan:
    """Walls as segments (x0, y0, x1, y1) in pixels of the sheet, top row first; doors are left out of them."""

    walls: list[tuple[int, int, int, int]]
    rooms: list[tuple[int, int, int, int]]

    @property
    def contour(self) -> tuple[int, int, int, int]:
        corners = np.array(self.rooms)
        return (*map(int, corners[:, :2].min(axis=0)), *map(int, corners[:, 2:].max(axis=0)))  # type: ignore[return-value]


@dataclass(frozen=True)
class PlanPicture:
    """A picture's file, and the true free space on the sheet."""

    path: Path
    free: Mask


def plan_of(rng: np.random.Generator) -> Plan:
    """A building of rooms joined by doors: a rectangle divided again and again, with a door in every dividing wall."""
    rows, cols = SHEET
    x0, y0 = MARGIN + int(rng.integers(0, 40)), MARGIN + int(rng.integers(0, 30))
    x1, y1 = cols - MARGIN - int(rng.integers(0, 40)), rows - MARGIN - int(rng.integers(0, 30))
    walls = [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]
    rooms, open_parts = [], [(x0, y0, x1, y1)]
    doors: list[tuple[int, int]] = []
    while open_parts:
        left, top, right, bottom = open_parts.pop()
        is_wide = right - left > bottom - top
        low, high = (left, right) if is_wide else (top, bottom)
        places = [
            p
            for p in range(low + MIN_ROOM, high - MIN_ROOM, 5)
            if all(abs(p - d[is_wide ^ 1]) > DOOR for d in doors)
        ]
        if not places or (len(rooms) > 1 and rng.random() < 0.15):
            rooms.append((left, top, right, bottom))
            continue
        at = int(rng.choice(places))
        start, end = (top, bottom) if is_wide else (left, right)
        door = int(rng.integers(start + 15, end - 15 - DOOR))
        for a, b in ((start, door), (door + DOOR, end)):
            walls.append((at, a, at, b) if is_wide else (a, at, b, at))
        middle = door + DOOR // 2
        doors.append((at, middle) if is_wide else (middle, at))
        if is_wide:
            open_parts += [(left, top, at, bottom), (at, top, right, bottom)]
        else:
            open_parts += [(left, top, right, at), (left, at, right, bottom)]
    return Plan(walls, rooms)


def free_of(plan: Plan, stroke: int) -> Mask:
    """The true free space `(rows, cols)`, top row first."""
    x0, y0, x1, y1 = plan.contour
    free = np.zeros(SHEET, np.uint8)
    free[y0 : y1 + 1, x0 : x1 + 1] = 1
    for a, b, c, d in plan.walls:
        cv2.line(free, (a, b), (c, d), 0, stroke)
    return free > 0


def ink_of(plan: Plan, rng: np.random.Generator, stroke: int, wobble: float = 1.0, gaps: int = 0) -> Pixels:
    """Ink `(rows, cols)` from 0 to 1, drawn with an unsteady hand; `gaps` is the widest interruption in pixels."""
    ink = np.zeros(SHEET, np.uint8)
    for x0, y0, x1, y1 in plan.walls:
        length = float(np.hypot(x1 - x0, y1 - y0))
        along = np.linspace(0.0, 1.0, max(int(length / 25), 2))
        points = np.stack([x0 + along * (x1 - x0), y0 + along * (y1 - y0)], axis=1)
        points[1:-1] += rng.normal(0.0, wobble, (len(points) - 2, 2))
        pieces = [points]
        if gaps and length > 120:
            at = rng.uniform(0.2, 0.8) * length
            half = 0.5 * (rng.uniform(0.5, 1.0) * gaps + stroke)  # the pen's round ends fill a part
            pieces = [_between(points, 0.0, at - half), _between(points, at + half, length)]
        for piece in pieces:
            cv2.polylines(ink, [np.rint(piece * 16).astype(np.int32)], False, 255, stroke, cv2.LINE_AA, 4)
    return ink / 255.0


def _between(points: Pixels, start: float, end: float) -> Pixels:
    """The part of a polyline between two lengths along it."""
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    inner = points[(at > start) & (at < end)]
    ends = [np.array([np.interp(v, at, points[:, k]) for k in (0, 1)]) for v in (start, end)]
    return np.vstack([ends[0], inner, ends[1]])


def write_labels(ink: Pixels, plan: Plan, rng: np.random.Generator, pen: int = 2) -> None:
    """Add names of rooms, dimensions outside, a title and arrows to the ink."""
    canvas = np.zeros(SHEET, np.uint8)
    font = cv2.FONT_HERSHEY_SIMPLEX
    for number, (x0, y0, x1, y1) in enumerate(plan.rooms):
        text = str(rng.choice(["office", "R 12", "A", "kitchen", "lab", "WC", "store 3"]))
        size = float(rng.uniform(0.5, 0.7))
        (width, _), _ = cv2.getTextSize(text, font, size, pen)
        place = ((x0 + x1 - width) // 2, (y0 + y1) // 2)
        cv2.putText(canvas, text, place, font, size, 255, pen, cv2.LINE_AA)
        if number % 2 == 0:
            tail = (x0 + 25, (y0 + y1) // 2 + 28)
            end = (tail[0] + int(rng.integers(40, 70)), tail[1])
            cv2.arrowedLine(canvas, tail, end, 255, pen, cv2.LINE_AA, 0, 0.25)
    cv2.putText(canvas, "Ground floor 1:200", (300, 40), font, 0.8, 255, pen, cv2.LINE_AA)
    np.maximum(ink, canvas / 255.0, out=ink)


def shade(rng: np.random.Generator, shape: tuple[int, int], depth: float) -> Pixels:
    """Light from 0 to 1: a gradient and the shadow of a hand."""
    rows, cols = shape
    y, x = np.mgrid[:rows, :cols] / max(shape)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    light = 1.0 - 0.4 * depth * (
        0.5 + 0.5 * np.sin(angle + 1.5 * x * np.cos(angle) + 1.5 * y * np.sin(angle))
    )
    cx, cy = rng.uniform(0.1, 0.9), rng.uniform(0.1, 0.6)
    hand = ((x - cx) / rng.uniform(0.15, 0.3)) ** 2 + ((y - cy) / rng.uniform(0.15, 0.3)) ** 2
    return np.asarray(light * (1.0 - depth * 0.55 * np.exp(-hand)), np.float32)


def noisy(picture: Pixels, rng: np.random.Generator, deviation: float) -> NDArray[np.uint8]:
    smooth = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.7)
    smooth += np.float32(deviation) * rng.standard_normal(picture.shape, np.float32)
    return np.asarray(np.clip(np.rint(smooth), 0, 255).astype(np.uint8))


def pencil_on(ink: Pixels, rng: np.random.Generator) -> Pixels:
    """Ink as faint as pencil: its pressure varies along the strokes, and the paper has grain."""
    pressure = cv2.resize(rng.uniform(0.6, 1.0, (20, 28)), SHEET[::-1], interpolation=cv2.INTER_CUBIC)
    grain = rng.uniform(0.6, 1.0, SHEET)
    return np.asarray(ink * pressure * grain * 0.45)


def on_table(sheet: NDArray[np.uint8], rng: np.random.Generator, scale: float = 1.0) -> NDArray[np.uint8]:
    """A photograph `(rows, cols, 3)` of the sheet on a table, from a camera held at an angle."""
    rows, cols = sheet.shape[:2]
    height, width = round(960 * scale), round(1280 * scale)
    corners = np.array([(0, 0), (cols, 0), (cols, rows), (0, rows)], np.float64) - (cols / 2, rows / 2)
    about_axis, tilt, pan = (
        np.radians(rng.uniform(-12, 12)),
        np.radians(rng.uniform(-30, 30)),
        np.radians(rng.uniform(-18, 18)),
    )
    about_z = np.array(
        [[np.cos(about_axis), -np.sin(about_axis), 0], [np.sin(about_axis), np.cos(about_axis), 0], [0, 0, 1]]
    )
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    about_y = np.array([[np.cos(pan), 0, np.sin(pan)], [0, 1, 0], [-np.sin(pan), 0, np.cos(pan)]])
    space = np.column_stack([corners, np.zeros(4)]) @ (about_y @ about_x @ about_z).T + (0, 0, 1500.0)
    focal = 1.1 * width
    image = focal * space[:, :2] / space[:, 2:]
    image *= min(1.0, 0.47 * width / np.abs(image[:, 0]).max(), 0.47 * height / np.abs(image[:, 1]).max())
    image += (width / 2, height / 2)
    warp = cv2.getPerspectiveTransform(
        (corners + np.array([cols / 2, rows / 2])).astype(np.float32), image.astype(np.float32)
    )
    tone = np.array(
        [(60, 45, 35), (150, 105, 70), (50, 50, 55), (120, 125, 130)][int(rng.integers(0, 4))], np.float64
    )
    wood = cv2.GaussianBlur(rng.standard_normal((height, width), np.float32), (0, 0), 12.0, sigmaY=0.8)
    photo = tone.astype(np.float32) * (1.0 + 0.8 * wood[..., None])
    colour = sheet if sheet.ndim == 3 else np.repeat(sheet[..., None], 3, axis=2)
    cover = cv2.warpPerspective(
        np.ones((rows, cols), np.float32), warp, (width, height), flags=cv2.INTER_AREA
    )
    shadow = cv2.GaussianBlur(np.roll(cover, (4, 4), axis=(0, 1)), (0, 0), 4.0)
    laid = cv2.warpPerspective(colour.astype(np.float32), warp, (width, height), flags=cv2.INTER_AREA)
    photo = photo * (1.0 - 0.4 * shadow[..., None]) * (1.0 - cover[..., None]) + laid
    return noisy(photo * shade(rng, (height, width), rng.uniform(0.3, 0.9))[..., None], rng, 3.0)


PEN, PAPER = 45.0, 235.0


def _on_paper(ink: Pixels) -> Pixels:
    return np.asarray(PAPER + (PEN - PAPER) * ink)


def picture_of(kind: str, seed: int, folder: Path) -> PlanPicture:
    """One picture of a plan."""
    rng = np.random.default_rng([seed, 7])
    plan = plan_of(rng)
    stroke = {"thin": 1, "thick": 9}.get(kind, 3)
    ink = ink_of(plan, rng, stroke, gaps=3 if kind == "gaps" else 8 if kind == "phone" else 0)
    if kind in ("text", "phone"):
        write_labels(ink, plan, rng)
    path = folder / f"{kind}_{seed}.{'jpg' if kind in JPEG else 'png'}"
    image, options = _image_of(kind, ink, rng)
    image.save(path, **options)
    return PlanPicture(path, free_of(plan, stroke))


def _image_of(kind: str, ink: Pixels, rng: np.random.Generator) -> tuple[Image.Image, dict[str, object]]:
    page = _on_paper(ink)
    if kind == "colour":
        inks = np.array([(225, 210, 30), (230, 60, 60), (70, 140, 230), (90, 200, 90)], np.float64)
        colour = inks[int(rng.integers(0, 4))]
        return Image.fromarray(np.rint(255 + ink[..., None] * (colour - 255)).astype(np.uint8)), {}
    if kind == "transparent":
        tone = np.full((*SHEET, 3), int(rng.choice([0, 255])), np.uint8)
        return Image.fromarray(np.dstack([tone, np.rint(ink * 255).astype(np.uint8)])), {}
    if kind == "bright":
        return Image.fromarray(np.rint(20 + 220 * ink).astype(np.uint8)), {}
    if kind == "jpeg":
        return Image.fromarray(noisy(page, rng, 4.0)), {"quality": 20}
    if kind == "sixteen_bit":
        return Image.fromarray(np.rint(page * 200).astype(np.uint16)), {}
    if kind == "light":
        return Image.fromarray(noisy(page * shade(rng, SHEET, 1.0), rng, 3.0)), {"quality": 80}
    if kind == "pencil":
        faint = _on_paper(pencil_on(ink, rng))
        return Image.fromarray(noisy(faint * shade(rng, SHEET, 0.7), rng, 2.5)), {"quality": 85}
    if kind == "exif":
        orientation = Image.Exif()
        orientation[0x0112] = 6  # the camera was turned: shown upright by a rotation clockwise
        return Image.fromarray(np.rot90(noisy(page, rng, 2.0)).copy()), {"quality": 90, "exif": orientation}
    if kind == "table":
        return Image.fromarray(on_table(page.astype(np.uint8), rng)), {"quality": 85}
    if kind == "table_pencil":
        return Image.fromarray(on_table(_on_paper(1.3 * pencil_on(ink, rng)).astype(np.uint8), rng)), {
            "quality": 90
        }
    if kind == "phone":
        tint = np.array([250.0, 242.0, 225.0]) / 255.0
        pen = np.array([(40, 60, 150), (35, 35, 40), (150, 30, 40)][int(rng.integers(0, 3))], np.float64)
        sheet = (1 - ink[..., None]) * 240.0 * tint + ink[..., None] * pen
        return Image.fromarray(on_table(np.rint(sheet).astype(np.uint8), rng, 1.25)), {"quality": 75}
    return Image.fromarray(np.rint(page).astype(np.uint8)), {}


JPEG = ("jpeg", "light", "pencil", "exif", "table", "table_pencil", "phone")
KINDS = ("pen", "thin", "thick", "bright", "gaps", "text", "colour", "transparent", "sixteen_bit", *JPEG)


def iou_of(picture: PlanPicture) -> float:
    """Intersection over union of the free space read from a picture and the true one; 0 if nothing was read."""
    try:
        drawn = drawn_map(load_drawing(picture.path))
    except MapError:
        return 0.0
    free = cv2.resize(drawn.free[::-1].astype(np.uint8), SHEET[::-1], interpolation=cv2.INTER_NEAREST) > 0
    return float((free & picture.free).sum() / (free | picture.free).sum())


def main() -> None:
    first, count = (int(v) for v in (sys.argv[1:] + ["0", "20"][len(sys.argv) - 1 :])[:2])
    kinds = sys.argv[3:] or KINDS
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            values = [iou_of(picture_of(kind, seed, Path(folder))) for seed in range(first, first + count)]
            worst = int(np.argmin(values))
            print(  # noqa: T201
                f"{kind:13s} mean {np.mean(values):.3f}  worst {values[worst]:.3f} (seed {first + worst})",
                flush=True,
            )


if __name__ == "__main__":
    main()
