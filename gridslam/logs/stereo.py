"""Left and right images of one moment as one stereo pair."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import side_of
from gridslam.core.messages import Image, StereoPair, readonly

SAME_MOMENT_NS = 5_000_000
_RECTIFIED, _RAW = re.compile(r"(?<![a-z])rect"), re.compile(r"(?<![a-z])raw")
_GREY_OF_RGB = np.array([299, 587, 114], dtype=np.uint32)  # ITU-R BT.601, in thousandths


def is_rectified(topic: str) -> bool:
    """Whether a topic of images says that they are rectified, as image_rect and image_rect_raw do."""
    return bool(_RECTIFIED.search(topic.lower().rsplit("/image", 1)[-1]))


def is_raw(topic: str) -> bool:
    """Whether a topic of images says that they are as the camera took them, like image_raw."""
    return bool(_RAW.search(topic.lower().rsplit("/image", 1)[-1])) and not is_rectified(topic)


class Pairing:
    """Waits for the other side of each image; both sides come in the order of their stamps."""

    def __init__(self) -> None:
        self._waiting: dict[str, Image] = {}

    def add(self, image: Image, topic: str) -> tuple[StereoPair | None, Image | None]:
        """Take an image; (the pair that it completes or None, an image that stays without a partner or None)."""
        side = side_of((image.camera, topic, image.frame_id))
        if not side:
            return None, image
        other = self._waiting.get("right" if side == "left" else "left")
        if other is not None and abs(other.stamp_ns - image.stamp_ns) <= SAME_MOMENT_NS:
            self._waiting.clear()
            left, right = (image, other) if side == "left" else (other, image)
            if left.pixels.shape[:2] != right.pixels.shape[:2]:
                return None, image
            pixels = grey(left.pixels), grey(right.pixels)
            return StereoPair(left.stamp_ns, left.frame_id, *pixels, left.is_raw), None
        unpaired = self._waiting.get(side)
        self._waiting[side] = image
        return None, unpaired

    def unpaired(self) -> list[Image]:
        """The images that still wait for their partner."""
        return list(self._waiting.values())


def grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey pixels `(rows, cols)` of a grey or RGB image."""
    if pixels.ndim == 2:
        return pixels
    return readonly((pixels.astype(np.uint32) @ _GREY_OF_RGB + 500) // 1000, np.uint8)
