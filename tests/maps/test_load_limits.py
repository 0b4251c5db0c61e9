"""Pictures of maps whose sizes ask for more memory than there is."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gridslam.core.errors import MapError
from gridslam.maps.drawings.drawing import load_drawing
from gridslam.maps.image_levels import read_levels

CODE = """
import resource, sys
from pathlib import Path
from gridslam.core.errors import MapError
from gridslam.maps.drawings.drawing import load_drawing
from gridslam.maps.image_levels import read_levels
path = Path(sys.argv[1])
now = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (now + (1 << 30), -1))
for read in (read_levels, load_drawing):
    try:
        read(path)
    except MapError as error:
        print(error)
"""


def test_a_picture_that_says_it_has_2_gb_is_damaged(tmp_path: Path) -> None:
    file = io.BytesIO()
    Image.fromarray(np.arange(1200, dtype=np.uint8).reshape(30, 40)).save(file, "PNG")
    data = file.getvalue()
    at = data.index(b"IDAT") - 4
    path = tmp_path / "map.png"
    path.write_bytes(data[:at] + struct.pack(">I", 2**31 - 1) + data[at + 4 :])
    done = subprocess.run([sys.executable, "-c", CODE, path], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("not a readable") == 2


@pytest.mark.parametrize("before", [b"", b"4 ", b"4 3 255"])
@pytest.mark.parametrize("comments", [b"#" + b"x" * 70_000, b"#\n" * 35_000], ids=["one", "many"])
@pytest.mark.parametrize("load", [read_levels, load_drawing])
def test_comments_without_end_before_the_size_are_refused(
    tmp_path: Path, load: Callable[[Path], object], comments: bytes, before: bytes
) -> None:
    path = tmp_path / "map.pgm"
    path.write_bytes(b"P5\n" + before + comments + b"\n4 3\n255\n" + bytes(12))
    with pytest.raises(MapError, match="no complete header"):
        load(path)


def test_a_picture_of_the_grey_of_comments_is_read(tmp_path: Path) -> None:
    path = tmp_path / "map.pgm"
    path.write_bytes(b"P5\n# CREATOR: a map saver\n300 300\n255\n" + b"#" * 90_000)
    assert (read_levels(path).levels == ord("#")).all()


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "I;16"])
def test_a_large_picture_read_strip_by_strip_is_that_read_whole(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (23, 17, 4), np.uint8)
    image = Image.fromarray(pixels, "RGBA")
    image = (
        Image.fromarray(pixels[..., :2].copy().view(np.uint16)[..., 0])
        if mode == "I;16"
        else image.convert(mode)
    )
    image.save(tmp_path / "a.png", **({"transparency": 3} if mode == "P" else {}))
    whole = read_levels(tmp_path / "a.png")
    monkeypatch.setattr("gridslam.maps.image_levels.ROWS_AT_ONCE", 5)
    strips = read_levels(tmp_path / "a.png")
    np.testing.assert_array_equal(strips.levels, whole.levels)
    assert (strips.opaque is None) == (whole.opaque is None) == (mode not in ("LA", "P", "RGBA"))
    assert strips.opaque is None or np.array_equal(strips.opaque, whole.opaque)
    assert (strips.maximum, strips.translucent) == (whole.maximum, whole.translucent)
