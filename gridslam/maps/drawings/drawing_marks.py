"""Recognition of drawn marks that are no walls: text, arrows and specks, small parts that are not joined to walls.

Lengths are pixels, arrays are bool `(rows, cols)`. The *pen* is the usual width of the strokes, the *extent* of the drawing its
longer side.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Ints = NDArray[np.int64]

MAX_PARTS = 3000  # with more parts the picture is noise, in which no text is looked for
# Length of a wall as a fraction of the picture's longer side; longer parts give the extent
MIN_WALL_RATIO = 0.1
MAX_LETTER_RATIO = 0.06  # longer side of a letter, and height of a written word, as a fraction of the extent
MAX_WORD_RATIO = 0.25
MAX_ARROW_RATIO = 0.2
SPECK_PENS = 1.5  # a speck's longer side
SOLID_RATIO = 0.7  # covered fraction of the bounding box; a letter covers less, a pillar more
# Of the bounding box that is enclosed; a pillar's contour encloses more, a letter alone less.
HOLLOW_RATIO = 0.4
COMPACT_RATIO = 0.4  # shorter over longer side of a pillar
STRAIGHT_PENS = 1.8  # width up to which a part is a straight line
CURSIVE_LENGTHS = 2.2  # length of the strokes of a written word, in lengths of the word
LETTER_GAP = 0.7  # largest gap between letters of a word, in heights of the taller one
HEAD_PENS = 3.0  # width of an arrow's head
SHAFT_PENS = 1.8
BARB_RATIO = 0.25  # fraction of an arrow's head on either side of the shaft
TIP_RATIO = 0.75  # largest width of the tip as a fraction of the head's width
ARROW_BINS = 14


class Mark(IntEnum):
    """Class of a connected part of the strokes."""

    wall = 0
    speck = 1
    text = 2
    arrow = 3


class DrawingScale(NamedTuple):
    """The width of the pen and the extent of the drawing."""

    pen: float
    extent: float


@dataclass(frozen=True, slots=True)
class Marks:
    """`ignored` pixels `(rows, cols)`, and the numbers of letters or words, arrows and specks that they make up."""

    ignored: Mask
    texts: int = 0
    arrows: int = 0
    specks: int = 0


def marks_of(strokes: Mask, closed: Mask) -> Marks:
    """The parts of the strokes that are no walls.

    `closed` are the strokes with small gaps closed: parts that are joined to walls in them are walls too.
    """
    count, found_labels, stats, _ = cv2.connectedComponentsWithStats(strokes.astype(np.uint8), connectivity=8)
    labels = np.asarray(found_labels, np.int32)
    boxes = stats.astype(np.int64)
    long_side = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    walls = long_side >= MIN_WALL_RATIO * max(strokes.shape)
    walls[0] = False
    if not walls.any() or count > MAX_PARTS:
        return Marks(np.zeros_like(strokes))
    low = boxes[walls, :2].min(axis=0)
    high = (boxes[walls, :2] + boxes[walls, 2:4]).max(axis=0)
    extent = float((high - low).max())
    is_joined = _joined(labels, walls, closed)
    kinds = _kinds(labels, boxes, is_joined, DrawingScale(_pen_of(strokes), extent))
    found = np.bincount(kinds, minlength=len(Mark))
    return Marks(
        np.asarray((kinds > Mark.wall)[labels]),
        texts=int(found[Mark.text]),
        arrows=int(found[Mark.arrow]),
        specks=int(found[Mark.speck]),
    )


def _joined(labels: NDArray[np.int32], walls: Mask, closed: Mask) -> Mask:
    """Mask `(n,)` of the parts that are walls, or joined to them in the closed strokes."""
    count, closed_labels = cv2.connectedComponents(closed.astype(np.uint8), connectivity=8)
    with_wall = np.zeros(count, np.bool_)
    with_wall[closed_labels[walls[labels]]] = True
    joined = np.zeros(len(walls), np.bool_)
    joined[labels[with_wall[closed_labels]]] = True
    return joined


def _pen_of(strokes: Mask) -> float:
    """The usual width of the strokes: twice the median distance from their middle to their border."""
    distance = cv2.distanceTransform(np.pad(strokes, 1).astype(np.uint8), cv2.DIST_L2, 5)
    middle = (distance > 0) & (distance >= cv2.dilate(distance, np.ones((3, 3), np.uint8)))
    return max(2.0 * float(np.median(distance[middle])) - 1.0, 1.0)


def _kinds(labels: NDArray[np.int32], boxes: Ints, is_joined: Mask, scale: DrawingScale) -> Ints:
    """Class `(n,)` of each part, a `Mark`; part 0, the paper, counts as wall."""
    pen, extent = scale
    kinds = np.zeros(len(boxes), np.int64)
    long_side, short_side = boxes[:, 2:4].max(axis=1), boxes[:, 2:4].min(axis=1)
    letters, alone = [], []
    for part in range(1, len(boxes)):
        if is_joined[part] or long_side[part] > MAX_ARROW_RATIO * extent:
            continue
        if long_side[part] <= max(SPECK_PENS * pen, 3.0):
            kinds[part] = Mark.speck
            continue
        shape = _shape(labels, boxes, part)
        if _is_solid(shape):
            continue
        if long_side[part] <= MAX_LETTER_RATIO * extent:
            letters.append(part)
            alone.append(_is_letter(shape, pen))
        elif _is_arrow(shape, pen):
            kinds[part] = Mark.arrow
        elif short_side[part] <= MAX_LETTER_RATIO * extent and long_side[part] <= MAX_WORD_RATIO * extent:
            kinds[part] = Mark.text if _is_cursive(shape, pen) else Mark.wall
    for group in _groups(boxes[letters]):
        parts = [letters[k] for k in group]
        if len(group) == 1:
            shape = _shape(labels, boxes, parts[0])
            kinds[parts[0]] = (
                Mark.arrow if _is_arrow(shape, pen) else Mark.text if alone[group[0]] else Mark.wall
            )
        elif _breadth(np.argwhere(np.isin(labels, parts))) > STRAIGHT_PENS * pen:  # else a dashed wall
            kinds[parts] = Mark.text
    return kinds


def _shape(labels: NDArray[np.int32], boxes: Ints, part: int) -> Mask:
    """The pixels of a part within its bounding box."""
    x, y, width, height = boxes[part, :4]
    return np.asarray(labels[y : y + height, x : x + width] == part)


def _is_solid(shape: Mask) -> bool:
    """Whether a part is a filled pillar. A blurred word is filled too, but between its letters, and not in its middle."""
    rows, cols = np.nonzero(shape)
    (_, size, _) = cv2.minAreaRect(np.stack([cols, rows], axis=1).astype(np.float32))
    width, height = size[0] + 1.0, size[1] + 1.0
    short = min(width, height)
    is_full = shape.sum() > SOLID_RATIO * width * height and _thickness(shape) > SOLID_RATIO * short
    return bool(is_full and short > COMPACT_RATIO * max(width, height))


def _is_letter(shape: Mask, pen: float) -> bool:
    """Whether a part without neighbours is a letter: neither a straight line nor the contour of a pillar."""
    return _enclosed_ratio(shape) < HOLLOW_RATIO and _breadth(np.argwhere(shape)) > STRAIGHT_PENS * pen


def _is_cursive(shape: Mask, pen: float) -> bool:
    length = float(shape.sum()) / pen
    return length > CURSIVE_LENGTHS * max(shape.shape) and _enclosed_ratio(shape) < HOLLOW_RATIO


def _enclosed_ratio(shape: Mask) -> float:
    """Fraction of the bounding box that the part encloses."""
    contours, _ = cv2.findContours(shape.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(shape.shape, np.uint8)
    cv2.drawContours(filled, contours, -1, 1, cv2.FILLED)
    return float((filled > 0).sum() - shape.sum()) / shape.size


def _breadth(cells: Ints) -> float:
    """Width of the narrowest rectangle around cells `(n, 2)`."""
    return float(min(cv2.minAreaRect(cells.astype(np.float32))[1])) + 1.0


def _thickness(shape: Mask) -> float:
    """Diameter of the largest disc in the part."""
    return 2.0 * float(cv2.distanceTransform(np.pad(shape, 1).astype(np.uint8), cv2.DIST_L2, 5).max()) - 1.0


def _is_arrow(shape: Mask, pen: float) -> bool:
    """Whether a part is a straight shaft with a head: widest near an end, narrow at that end and in the middle."""
    cells = np.argwhere(shape).astype(np.float64)
    if len(cells) < ARROW_BINS:
        return False
    cells -= cells.mean(axis=0)
    axis = np.linalg.eigh(cells.T @ cells)[1][:, 1]
    along, across = cells @ axis, cells @ np.array([-axis[1], axis[0]])
    across -= np.median(across)
    low, high = along.min(), along.max()
    if (
        _thickness(shape) > SHAFT_PENS * pen + 1.0
        or high - low < 4.0 * pen
        or high - low < 1.5 * float(np.ptp(across))
    ):
        return False
    bins = np.minimum(((along - low) / (high - low) * ARROW_BINS).astype(np.int64), ARROW_BINS - 1)
    width = np.array(
        [np.ptp(across[bins == k]) + 1.0 if (bins == k).any() else 0.0 for k in range(ARROW_BINS)]
    )
    narrow = np.sort(width)[: ARROW_BINS // 2].max() <= SHAFT_PENS * pen + 1.0
    widest = int(width.argmax())
    near_end = min(widest, ARROW_BINS - 1 - widest)
    tip = width[0] if widest < ARROW_BINS / 2 else width[-1]
    head = across[bins == widest]
    has_barbs = min(-head.min(), head.max()) > BARB_RATIO * width[widest]
    has_head = width[widest] >= HEAD_PENS * pen and 1 <= near_end <= ARROW_BINS // 2 - 1 and has_barbs
    return bool(narrow and has_head and tip < TIP_RATIO * width[widest])


def _groups(boxes: Ints) -> list[list[int]]:
    """Indices of neighbouring boxes (x, y, width, height, ...), group by group."""
    count = len(boxes)
    if not count:
        return []
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:4]
    apart = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
    height = boxes[:, 2:4].max(axis=1)
    joined = apart <= LETTER_GAP * np.maximum(height[:, None], height[None])
    group = np.arange(count)
    for k in range(count):
        members = np.flatnonzero(joined[k])
        group[np.isin(group, group[members])] = group[members].min()
    return [np.flatnonzero(group == g).tolist() for g in np.unique(group)]
