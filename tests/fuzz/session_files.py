"""session.npz whose arrays, archive or bytes are damaged."""

from __future__ import annotations

import io
import json
import random
import re
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.numpy_files import npz_bytes, read_npz
from gridslam.lidar_slam.sessions.session_file import DIGEST, with_digest
from tests.fuzz.damage import changed
from tests.fuzz.value_trees import ODD


def _odd_array(values: NDArray[Any], rng: random.Random) -> NDArray[Any]:
    """An array of the same name with other values, another type or another shape."""
    values = np.array(values)
    what = rng.randrange(7)
    if what == 0 and values.size:
        odd = (
            (np.nan, np.inf, 1e300, -1.0)
            if values.dtype.kind == "f"
            else (0, 1, -1, np.iinfo(values.dtype).max, np.iinfo(values.dtype).min)
        )
        values.flat[rng.randrange(values.size)] = np.array(rng.choice(odd)).astype(values.dtype)
    elif what == 1:
        values = values.astype(rng.choice(("<f4", ">i8", "<U3", "?", "<c16", "<f8")))
    elif what == 2:
        values = values[: rng.randrange(len(values) + 1)] if values.ndim else values
    elif what == 3:
        values = values.reshape(rng.choice(((-1,), (1, -1), (-1, 1, 1))))
    elif what == 4 and values.size:
        values = np.repeat(values, rng.choice((2, 50)), axis=0)
    elif what == 5 and values.size > 1:
        values = values[::-1].copy()
    elif values.size:
        values = np.full_like(values, rng.choice((0, 1, 7)))
    return values


def damaged_session(content: bytes, rng: random.Random) -> bytes:
    """The bytes of session.npz with changed arrays, entries of the archive, or bytes."""
    what = rng.randrange(5)
    if what == 0:
        return changed(content, rng) if rng.random() < 0.7 else content[: rng.randrange(len(content))]
    arrays = read_npz(io.BytesIO(content), 1 << 28)
    if what == 1:
        head = json.loads(arrays["head"].tobytes())
        head[rng.choice(list(head))] = rng.choice([v for v in ODD if v != "\ud800"])
        arrays["head"] = np.frombuffer(json.dumps(head, default=str).encode(), np.uint8)
    elif what == 2:
        names = list(arrays)
        first, second = rng.choice(names), rng.choice(names)
        arrays[first], arrays[second] = arrays[second], arrays[first]
    else:
        for name in rng.sample(list(arrays), rng.choice((1, 1, 2))):
            arrays[name] = _odd_array(arrays[name], rng)
    if rng.random() < 0.9:  # otherwise the digest alone shows the damage
        arrays.pop(DIGEST, None)
        arrays = dict(with_digest(arrays.items()))
    packed = npz_bytes(arrays.items())
    return _odd_archive(packed, rng) if rng.random() < 0.2 else packed


def _odd_archive(content: bytes, rng: random.Random) -> bytes:
    """The archive with one entry twice, pickled, renamed, huge, or with a header that lies."""
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(content)) as old,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        chosen = rng.choice(old.namelist())
        for name in old.namelist():
            data = old.read(name)
            if name == chosen:
                pickled = io.BytesIO()
                np.save(pickled, np.array([{"a": 1}], dtype=object), allow_pickle=True)
                length = re.sub(
                    rb"\((\d+)", b"(" + rng.choice((b"0", b"-1", b"9" * 30, b"99999999")), data, count=1
                )
                data = rng.choice(
                    (pickled.getvalue(), length, bytes(70 << 20), b"", data[:9], changed(data, rng))
                )
                name = rng.choice((name, name, "../../x.npy", "\x1b[31m.npy", name.upper()))
            new.writestr(name, data)
    return buffer.getvalue()
