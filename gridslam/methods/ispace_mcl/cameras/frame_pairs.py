"""Colour and depth images of the fixed cameras joined to frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import DepthImage, Image

PAIR_TOLERANCE_S = 0.02  # colour and depth of one frame; most drivers stamp both alike
# Images of one kind without any of the other, after which a camera counts as one that has no others
ALONE_AFTER = 3


@dataclass(frozen=True, slots=True)
class Frame:
    """Colour and depth image of a camera at a moment; one of them is None if the camera has but the other kind."""

    image: Image | None
    depth: DepthImage | None

    @property
    def stamp_ns(self) -> int:
        """The stamp of the colour image, where there is one."""
        message = self.image or self.depth
        assert message is not None
        return message.stamp_ns

    @property
    def streams(self) -> tuple[str, ...]:
        """The streams of its images: image, depth or both."""
        return (*(("image",) if self.image else ()), *(("depth",) if self.depth else ()))

    @property
    def shape(self) -> tuple[int, int] | None:
        """Rows and columns; None if the two images differ in size."""
        shapes = [p.shape[:2] for p in (self.pixels, self.depth_m) if p is not None]
        return (shapes[0][0], shapes[0][1]) if shapes[0] == shapes[-1] else None

    @property
    def pixels(self) -> NDArray[np.uint8] | None:
        """Pixels `(rows, cols)` or `(rows, cols, 3)` of the colour image, if there is one."""
        return None if self.image is None else self.image.pixels

    @property
    def depth_m(self) -> NDArray[np.float32] | None:
        """Depths `(rows, cols)` (m) of the depth image, if there is one."""
        return None if self.depth is None else self.depth.depth_m


class FramePairs:
    """Joins the images of each camera; calls `drop(name, image)` for every one that finds no partner."""

    def __init__(self, drop: Callable[[str, Image | DepthImage], None]) -> None:
        self._drop = drop
        self._waiting: dict[tuple[str, type], Image | DepthImage] = {}
        self._seen: Counter[tuple[str, type]] = Counter()

    def add(self, message: Image | DepthImage) -> Frame | None:
        """Add an image; returns the frame that it completes."""
        name, kind = message.frame_id, type(message)
        other = DepthImage if isinstance(message, Image) else Image
        self._seen[name, kind] += 1
        if not self._seen[name, other] and self._seen[name, kind] > ALONE_AFTER:
            return _frame(message)
        if (before := self._waiting.pop((name, kind), None)) is not None:
            self._drop(name, before)
        partner = self._waiting.pop((name, other), None)
        if partner is None:
            self._waiting[name, kind] = message
            return None
        apart_s = (message.stamp_ns - partner.stamp_ns) * 1e-9
        if abs(apart_s) <= PAIR_TOLERANCE_S:
            return _frame(message, partner)
        older, newer = (message, partner) if apart_s < 0.0 else (partner, message)
        self._drop(name, older)  # it will find no partner any more
        self._waiting[name, type(newer)] = newer
        return None

    def finish(self) -> None:
        """Drop all images that still wait."""
        for (name, _), message in self._waiting.items():
            self._drop(name, message)
        self._waiting.clear()


def _frame(*messages: Image | DepthImage) -> Frame:
    """The frame of one or two images."""
    image = next((m for m in messages if isinstance(m, Image)), None)
    return Frame(image, next((m for m in messages if isinstance(m, DepthImage)), None))
