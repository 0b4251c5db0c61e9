"""Camera images in the encodings of ROS drivers, raw and compressed, against a picture that is known."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Pillow

from gridslam.core.messages import DepthImage, Image
from gridslam.logs import open_log
from gridslam.logs.encoding.cameras import rows_of
from gridslam.logs.encoding.image_encodings import RawImage, compressed_depth, compressed_pixels, pixels_of
from gridslam.logs.skips import SkipReason, UnusableMessageError
from tests.logs.ros_samples import header, make, write_mcap

Pixels = NDArray[np.uint8]

ROWS, COLS = 24, 32


def colours() -> Pixels:
    """A smooth RGB picture `(rows, cols, 3)`."""
    row, col = np.mgrid[:ROWS, :COLS]
    picture = np.stack([40 + 5 * col, 60 + 6 * row, 200 - 2 * row - 2 * col], axis=-1)
    return picture.astype(np.uint8)


def raw(encoding: str, values: NDArray[np.generic], padding: int = 0, big: bool = False) -> RawImage:
    """An image message whose rows are padded."""
    packed = np.ascontiguousarray(values).reshape(len(values), -1).view(np.uint8)
    padded = np.pad(packed, ((0, 0), (0, padding)))
    return RawImage(encoding, ROWS, COLS, padded.shape[1], padded.tobytes(), big)


def bayer(pattern: str) -> Pixels:
    """One colour for each pixel, as a sensor with this pattern measures it."""
    rgb, mosaic = colours(), np.zeros((ROWS, COLS), np.uint8)
    for k, letter in enumerate(pattern):
        row, col = divmod(k, 2)
        mosaic[row::2, col::2] = rgb[row::2, col::2, "rgb".index(letter)]
    return mosaic


def largest_difference(one: Pixels, other: Pixels) -> int:
    """Of the inner pixels: demosaicing is not exact at the border."""
    inner = np.s_[2:-2, 2:-2]
    return int(np.abs(one[inner].astype(int) - other[inner].astype(int)).max())


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "order"),
    [
        ("rgb8", [0, 1, 2]),
        ("bgr8", [2, 1, 0]),
        ("8UC3", [2, 1, 0]),
        ("rgb16", [0, 1, 2]),
        ("bgr16", [2, 1, 0]),
    ],
)
def test_three_channels_become_rgb(encoding: str, order: list[int], padding: int) -> None:
    values = colours()[..., order]
    wide = values.astype(np.uint16) << 8 if encoding.endswith("16") else values
    assert np.array_equal(pixels_of(raw(encoding, wide, 2 * padding)), colours())


@pytest.mark.parametrize(("encoding", "order"), [("rgba8", [0, 1, 2, 0]), ("bgra8", [2, 1, 0, 0])])
def test_alpha_is_dropped(encoding: str, order: list[int]) -> None:
    assert np.array_equal(pixels_of(raw(encoding, colours()[..., order])), colours())


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize("big", [False, True])
def test_sixteen_bits_keep_the_upper_eight_of_those_in_use(bits: int, big: bool) -> None:
    grey = np.linspace(0, 255, ROWS * COLS).astype(np.uint16).reshape(ROWS, COLS)
    values = (grey << (bits - 8)).astype(">u2" if big else "<u2")
    assert np.array_equal(pixels_of(raw("mono16", values, big=big)), grey.astype(np.uint8))


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("bits", [8, 16])
def test_bayer_patterns_are_demosaiced(pattern: str, bits: int) -> None:
    mosaic = bayer(pattern)
    values = mosaic.astype("<u2") << 8 if bits == 16 else mosaic
    found = pixels_of(raw(f"bayer_{pattern}{bits}", values))
    assert largest_difference(found, colours()) <= 3


@pytest.mark.parametrize("encoding", ["yuv422", "uyvy", "yuv422_yuy2", "yuyv"])
def test_packed_yuv_is_converted(encoding: str) -> None:
    is_uyvy = encoding in ("yuv422", "uyvy")
    code = cv2.COLOR_RGB2YUV_UYVY if is_uyvy else cv2.COLOR_RGB2YUV_YUYV
    assert largest_difference(pixels_of(raw(encoding, cv2.cvtColor(colours(), code))), colours()) <= 8


def test_planar_yuv_is_converted() -> None:
    planes = cv2.cvtColor(colours(), cv2.COLOR_RGB2YUV_I420).reshape(-1)
    luma, u, v = np.split(planes, [ROWS * COLS, ROWS * COLS * 5 // 4])
    for encoding, first, second in (("nv12", u, v), ("nv21", v, u)):
        chroma = np.stack([first, second], axis=1).reshape(-1, COLS)
        values = np.vstack([luma.reshape(ROWS, COLS), chroma])
        assert largest_difference(pixels_of(raw(encoding, values)), colours()) <= 10


@pytest.mark.parametrize("encoding", ["rgb8", "mono16", "bayer_rggb8", "yuv422", "nv12"])
def test_a_message_with_too_few_bytes_is_damaged(encoding: str) -> None:
    with pytest.raises(ValueError, match="disagree"):
        pixels_of(RawImage(encoding, ROWS, COLS, COLS, bytes(ROWS * COLS // 2)))


def test_another_encoding_is_named() -> None:
    with pytest.raises(UnusableMessageError) as raised:
        pixels_of(RawImage("yuv411p", ROWS, COLS, COLS, bytes(9999)))
    assert (raised.value.reason, raised.value.detail) == (SkipReason.UNKNOWN_ENCODING, "yuv411p")
    with pytest.raises(UnusableMessageError) as raised:
        compressed_pixels(b"\0\0\0\1", "h264")
    assert raised.value.detail == "h264"


def png(values: NDArray[np.generic]) -> bytes:
    """The bytes of a PNG."""
    buffer = io.BytesIO()
    Pillow.fromarray(values).save(buffer, format="PNG")
    return buffer.getvalue()


def test_a_png_of_16_bits_is_not_clipped() -> None:
    grey = np.arange(ROWS * COLS, dtype=np.uint16).reshape(ROWS, COLS) % 256
    assert np.array_equal(compressed_pixels(png(grey << 8), "mono16; png compressed"), grey.astype(np.uint8))


def test_a_compressed_bayer_picture_is_demosaiced() -> None:
    found = compressed_pixels(png(bayer("rggb")), "bayer_rggb8; png compressed")
    assert largest_difference(found, colours()) <= 3


def test_a_damaged_png_is_no_unknown_encoding() -> None:
    with pytest.raises(ValueError, match="not a picture"):
        compressed_pixels(png(colours())[:60], "rgb8; png compressed bgr8")


def test_compressed_depth_is_in_metres() -> None:
    depth = np.linspace(500, 9000, ROWS * COLS).astype(np.uint16).reshape(ROWS, COLS)
    depth[0, 0] = 0
    plain = compressed_depth(png(depth), "16UC1; png compressed")
    headed = compressed_depth(struct.pack("<iff", 0, 0.0, 0.0) + png(depth), "16UC1; compressedDepth png")
    assert np.isnan(plain[0, 0])
    assert plain[0, 1:] == pytest.approx(depth[0, 1:] / 1000.0)
    np.testing.assert_array_equal(plain, headed)


def test_quantised_inverse_depths_are_restored() -> None:
    depth = np.linspace(0.5, 9.0, ROWS * COLS).reshape(ROWS, COLS)
    a, b = 1000.0, 1.0 - 1000.0 / 10.0
    data = struct.pack("<iff", 0, a, b) + png(np.rint(a / depth + b).astype(np.uint16))
    assert compressed_depth(data, "32FC1; compressedDepth") == pytest.approx(depth, rel=0.06)


def test_depths_without_a_decoder_are_named() -> None:
    with pytest.raises(UnusableMessageError) as raised:
        compressed_depth(bytes(100), "16UC1; compressedDepth rvl")
    assert raised.value.detail == "16UC1; compressedDepth rvl"


def image_message(encoding: str, values: NDArray[np.generic]) -> object:
    """sensor_msgs/Image."""
    image = raw(encoding, values)
    return make(
        "sensor_msgs/msg/Image",
        header=header(10**9, "optical"),
        encoding=encoding,
        height=ROWS,
        width=COLS,
        step=image.step,
        data=np.frombuffer(image.data, np.uint8),
    )


def compressed_message(described: str, data: bytes) -> object:
    """sensor_msgs/CompressedImage."""
    return make(
        "sensor_msgs/msg/CompressedImage",
        header=header(10**9, "optical"),
        format=described,
        data=np.frombuffer(data, np.uint8),
    )


def test_sixteen_bit_grey_is_an_image_unless_its_topic_says_depth(tmp_path: Path) -> None:
    values = np.full((ROWS, COLS), 2500, "<u2")
    messages = [
        ("/left/image_raw", image_message("mono16", values)),
        ("/camera/depth/image_rect", image_message("mono16", values)),
        ("/camera/aligned", image_message("16UC1", values)),
        ("/tof/compressedDepth", compressed_message("16UC1; compressedDepth png", bytes(12) + png(values))),
        ("/right/image_raw/compressed", compressed_message("mono16; png compressed", png(values))),
    ]
    with open_log(write_mcap(tmp_path / "a.mcap", messages)) as log:
        found = list(log.events())
    images = [e for e in found if isinstance(e, Image)]
    depths = [e for e in found if isinstance(e, DepthImage)]
    assert sorted(image.camera for image in images) == ["left", "right"]
    assert {int(image.pixels[0, 0]) for image in images} == {2500 >> 4}
    assert [float(d.depth_m[0, 0]) for d in depths] == pytest.approx([2.5] * 3)


def test_a_log_names_the_encoding_that_it_cannot_decode(tmp_path: Path) -> None:
    message = image_message("mono8", np.zeros((ROWS, COLS), np.uint8))
    message.encoding = "yuv411p"  # type: ignore[attr-defined]
    path = write_mcap(tmp_path / "a.mcap", [("/left/image_raw", message)])
    with open_log(path) as log:
        assert not [e for e in log.events() if isinstance(e, Image)]
        assert any("yuv411p" in line for line in log.problems)


def test_a_single_row_that_claims_any_length_takes_the_memory_of_its_data() -> None:
    assert rows_of(bytes(range(8)), height=1, used=4, step=1 << 60).tolist() == [[0, 1, 2, 3]]
    assert rows_of(bytes(range(7)), height=2, used=3, step=4).tolist() == [[0, 1, 2], [4, 5, 6]]
