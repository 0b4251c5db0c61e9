"""Files that are small on disk and huge when they are believed."""

from __future__ import annotations

import io
import os
import resource
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from PIL import Image

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Image as ImageEvent
from gridslam.logs.encoding.cameras import MAX_PIXELS
from gridslam.logs.encoding.image_encodings import unpacked
from gridslam.logs.open import open_log
from gridslam.simulation import floor_plan as plans
from gridslam.simulation.floor_plan import plan_segments
from gridslam.simulation.world_config import FloorPlan

ADDRESS_SPACE = 1_500_000_000  # of the reading process; the bombs would take more


def png_of(width: int, height: int, rows: int = 0) -> bytes:
    """A grey PNG whose header states `rows` x `cols` pixels; only the first `rows` are there, all black."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    packer = zlib.compressobj(9)
    packed = b"".join(packer.compress(bytes(width + 1)) for _ in range(rows)) + packer.flush()
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    ("width", "height"), [(60_000, 60_000), (2**31 - 1, 2**31 - 1), (12_000, 12_000), (0, 5)]
)
def test_a_picture_that_says_it_is_huge_is_no_picture(width: int, height: int) -> None:
    with pytest.raises(ValueError, match="not a picture"):
        unpacked(png_of(width, height))


def test_a_large_picture_below_the_limit_is_read() -> None:
    assert MAX_PIXELS > 5000 * 4000
    assert unpacked(png_of(5000, 4000, 4000)).shape == (4000, 5000)


def test_bombs_in_a_csv_folder_are_counted_and_cost_no_memory(tmp_path: Path) -> None:
    """A process with little memory converts a log of them, and says what was lost."""
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "real.png").write_bytes(png_of(13_000, 13_000, 13_000))
    (tmp_path / "log" / "lie.png").write_bytes(png_of(50_000, 50_000, 2))
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    npy = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 1) + header + b"\n" + bytes(64)
    (tmp_path / "log" / "lie.npy").write_bytes(npy)
    good = io.BytesIO()
    Image.fromarray(np.full((4, 4), 9, np.uint8)).save(good, format="PNG")
    (tmp_path / "log" / "good.png").write_bytes(good.getvalue())
    (tmp_path / "log" / "image.csv").write_text(
        "stamp,camera,file\n1,a,real.png\n2,a,lie.png\n3,a,good.png\n"
    )
    (tmp_path / "log" / "depth.csv").write_text("stamp,camera,file\n1,a,lie.npy\n2,a,lie.png\n")
    program = "import sys; from gridslam.cli.main import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", program, "convert", tmp_path / "log", tmp_path / "out.mcap"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE)),
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("skipped 2 x") == 2
    assert "Warning" not in done.stderr
    with open_log(tmp_path / "out.mcap") as log:
        (image,) = [event for event in log.events() if isinstance(event, ImageEvent)]
    assert image.pixels.shape[:2] == (4, 4)


def test_a_pipe_in_a_csv_folder_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "image.csv").write_text("stamp,camera,file\n1,a,pipe.png\n")
    with open_log(tmp_path) as log:
        assert not any(isinstance(event, ImageEvent) for event in log.events())
        assert log.counters["skipped.image.missing_file"] == 1


def test_a_chunk_that_inflates_beyond_the_memory_is_lost_and_no_other(tmp_path: Path) -> None:
    """600 MB of zeros in 20 kB of zstd, between two good chunks."""
    path = tmp_path / "bomb.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=100)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/noise", "cdr", schema)
        for number in range(3):
            size = 600_000_000 if number == 1 else 100
            writer.add_message(channel, number, bytes(size), number)
        writer.finish()
    assert path.stat().st_size < 200_000
    with open_log(path) as log:
        assert log.counters["lost.chunk_of_impossible_size"] == 1
        assert sum(info.count for info in log.streams) == 2


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("lie.png", png_of(40_000, 40_000), "plan.file.*(pixels|picture)"),
        ("large.png", png_of(8_000, 8_000), "at most 25000000 are read"),
        ("script.eps", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\nquit\n", "not a readable picture"),
        ("cut.png", png_of(100, 100, 100)[:50], "not a readable picture"),
    ],
    ids=["lie", "large", "script", "cut"],
)
def test_a_plan_that_is_no_harmless_picture_is_refused(
    tmp_path: Path, name: str, data: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(data)
    assert plans.MAX_PIXELS == 25_000_000
    with pytest.raises(ConfigError, match=message):
        plan_segments(FloorPlan(file=name, resolution_m=0.05), tmp_path)
