"""Pixels of camera images: the raw encodings of ROS and Foxglove, and compressed pictures.

Encodings: https://docs.ros.org/en/api/sensor_msgs (image_encodings), https://wiki.ros.org/compressed_depth_image_transport
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.logs.encoding.cameras import opened_picture, rows_of
from gridslam.logs.skips import SkipReason, UnusableMessageError

Pixels = NDArray[np.uint8]

# Channels and bytes per channel of encodings whose pixels lie one after another.
_PLAIN = {
    **dict.fromkeys(("mono8", "8UC1"), (1, 1)),
    **dict.fromkeys(("rgb8", "bgr8", "8UC3"), (3, 1)),
    **dict.fromkeys(("rgba8", "bgra8", "8UC4"), (4, 1)),
    "mono16": (1, 2),
    **dict.fromkeys(("rgb16", "bgr16", "16UC3"), (3, 2)),
    **dict.fromkeys(("rgba16", "bgra16", "16UC4"), (4, 2)),
}
_BLUE_FIRST = ("bgr", "8UC", "16UC")
_BAYER = {
    "rggb": "COLOR_BayerRGGB2RGB",
    "bggr": "COLOR_BayerBGGR2RGB",
    "gbrg": "COLOR_BayerGBRG2RGB",
    "grbg": "COLOR_BayerGRBG2RGB",
}
_PACKED_YUV = {
    **dict.fromkeys(("yuv422", "uyvy"), "COLOR_YUV2RGB_UYVY"),
    **dict.fromkeys(("yuv422_yuy2", "yuyv", "yuy2"), "COLOR_YUV2RGB_YUYV"),
}
_PLANAR_YUV = {"nv12": "COLOR_YUV2RGB_NV12", "nv21": "COLOR_YUV2RGB_NV21"}
_COMPRESSED = ("jpeg", "jpg", "png")
_DEPTH_HEADER = struct.Struct("<iff")  # format, and the two parameters of quantised inverse depths


@dataclass(frozen=True, slots=True)
class RawImage:
    """The fields of a raw image message; `step` is the length of a row in bytes."""

    encoding: str
    height: int
    width: int
    step: int
    data: bytes
    is_bigendian: bool = False

    def rows(self, used: int, height: int | None = None) -> Pixels:
        """The first `used` bytes of each row `(height, used)`. Raises ValueError: the message has fewer."""
        return rows_of(self.data, self.height if height is None else height, used, self.step)


def pixels_of(image: RawImage) -> Pixels:
    """Grey `(rows, cols)` or RGB `(rows, cols, 3)` pixels. Raises UnusableMessageError: another encoding."""
    encoding, height, width = image.encoding, image.height, image.width
    if encoding in _PLAIN:
        return _plain(image, *_PLAIN[encoding])
    lowered = encoding.lower()
    if lowered.startswith("bayer_") and lowered[6:10] in _BAYER and lowered[10:] in ("8", "16"):
        return _demosaiced(_plain(image, 1, int(lowered[10:]) // 8), lowered[6:10])
    if lowered in _PACKED_YUV:
        if width % 2:
            raise ValueError("YUV 4:2:2 images have an even width")
        pixels = image.rows(2 * width).reshape(height, width, 2)
        return _converted(pixels, _PACKED_YUV[lowered])
    if lowered in _PLANAR_YUV:
        if width % 2 or height % 2:
            raise ValueError("YUV 4:2:0 images have an even width and height")
        return _converted(image.rows(width, height * 3 // 2), _PLANAR_YUV[lowered])
    raise UnusableMessageError(SkipReason.UNKNOWN_ENCODING, encoding)


def _plain(image: RawImage, channels: int, size: int) -> Pixels:
    """Grey or RGB pixels of `channels` values of `size` bytes."""
    values = image.rows(image.width * channels * size)
    if size == 2:
        order = ">" if image.is_bigendian else "<"
        values = eight_bits(values.view(f"{order}u2"))
    if channels == 1:
        return values
    pixels = values.reshape(image.height, image.width, channels)
    return pixels[:, :, 2::-1] if image.encoding.startswith(_BLUE_FIRST) else pixels[:, :, :3]


def eight_bits(values: NDArray[np.uint16]) -> Pixels:
    """The upper eight of the significant bits of 16-bit values, as an array of the same shape.

    Significant are 16 bits, or 12, 10 or 8 if no value uses more.
    """
    highest = int(values.max(initial=0))
    bits = next(bits for bits in (8, 10, 12, 16) if highest < 1 << bits)
    return np.asarray(values >> (bits - 8), np.uint8)


def _converted(pixels: Pixels, conversion: str) -> Pixels:
    """The pixels after a colour conversion of OpenCV, which is imported when it is needed."""
    import cv2

    return np.asarray(cv2.cvtColor(pixels, getattr(cv2, conversion)), np.uint8)


def _demosaiced(raw: Pixels, pattern: str) -> Pixels:
    """RGB pixels of a Bayer pattern."""
    if min(raw.shape) < 2:
        raise ValueError("a Bayer image has at least 2 x 2 pixels")
    return _converted(raw, _BAYER[pattern])


def compressed_pixels(data: bytes, described: str) -> Pixels:
    """Grey or RGB pixels of a PNG or JPEG, 16-bit ones in eight bits.

    `described` is the format that the message states, like "bayer_rggb8; png compressed". Raises UnusableMessageError: it
    is another format. ValueError: the picture is damaged.
    """
    try:
        pixels = unpacked(data)
    except ValueError as error:
        if described and not any(name in described.lower() for name in _COMPRESSED):
            raise UnusableMessageError(SkipReason.UNKNOWN_ENCODING, described) from error
        raise
    original = described.split(";")[0].strip().lower()
    if pixels.ndim == 2 and original.startswith("bayer_") and original[6:10] in _BAYER:
        return _demosaiced(pixels, original[6:10])
    return pixels


def unpacked(data: bytes) -> Pixels:
    """Grey or RGB pixels of a PNG or JPEG. Raises ValueError: it is none, or is absurdly large."""
    with opened_picture(data, ("PNG", "JPEG")) as picture:
        if picture.mode.startswith("I"):
            return eight_bits(np.asarray(picture).astype(np.uint16))
        mode = "L" if picture.mode in ("1", "L", "LA") else "RGB"
        return np.asarray(picture.convert(mode))


def compressed_depth(data: bytes, described: str) -> NDArray[np.float32]:
    """Depths in metres of a 16-bit PNG, plain or with the header of compressedDepth; NaN for none.

    `described` is like "16UC1; compressedDepth png". Values are millimetres; those of "32FC1" are quantised inverse depths:
    depth = a / (value - b). Raises UnusableMessageError: another compression, like RVL.
    """
    if "rvl" in described.lower():
        raise UnusableMessageError(SkipReason.UNKNOWN_ENCODING, described)
    is_quantised = described.split(";")[0].strip() == "32FC1"
    a = b = 0.0
    if "compressedDepth" in described:
        _, a, b = _DEPTH_HEADER.unpack_from(data)
        data = data[_DEPTH_HEADER.size :]
    with opened_picture(data, ("PNG",)) as picture:
        values = np.asarray(picture).astype(np.float32)
    if values.ndim != 2:
        raise ValueError("depths have one channel")
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.float32(a) / (values - np.float32(b)) if is_quantised else values / np.float32(1000.0)
    return np.where(values == 0, np.float32(np.nan), depth).astype(np.float32)
