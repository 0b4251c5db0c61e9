"""Pictures of maps whose sizes ask for more memory than there is."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

CODE = """
import resource, sys
from pathlib import Path
from gridslam.core.errors import MapError
from gridslam.maps.drawing import load_drawing
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
