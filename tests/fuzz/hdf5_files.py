"""HDF5 files whose data sets, attributes, links and bytes are odd."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np

from gridslam.logs.kinds import CSV_KINDS
from tests.fuzz.damage import changed

ROWS = (0, 1, 3, 12, 12, 12, 300)
ODD_NUMBERS = (float("nan"), float("inf"), -1.0, 1e300, 1e-320, 0.0, 4e9, 2.0**63)
NAMES = ("", "a\nb", "\x1b[31m", "r0", "x" * 300, "a,b", '"', "stamp", "\u202e", "ranges", "..")
LIMITS = {"angle_min": -1.0, "angle_increment": 0.1, "range_min": 0.05, "range_max": 30.0}
CLAIMED_BYTES = 1 << 36  # bytes that a small file claims to hold


def fuzz_hdf5(path: Path, sample: Path, rng: random.Random) -> Path:
    """Groups named like kinds, most of them readable; a third of the files are damaged bytes."""
    import h5py

    path.unlink(missing_ok=True)
    rows = rng.choice(ROWS)
    with h5py.File(path, "w", libver=rng.choice(("earliest", "latest"))) as file:
        for kind in ("scan", *rng.sample(sorted(set(CSV_KINDS) - {"scan"}), 2)):
            group = file.require_group(kind)
            for name in ("stamp", *CSV_KINDS[kind].required, *CSV_KINDS[kind].optional):
                if rng.random() < 0.99:
                    _column(group, name, rows, rng)
            if CSV_KINDS[kind].has_ranges:
                _column(group, rng.choice(("r", "ranges")), rows, rng, width=rng.choice((1, 5, 5, 20)))
        for name, value in LIMITS.items():
            _attribute(file["scan"], name, value, rng)
        if rng.random() < 0.15:
            _link(file, rng)
    if rng.random() < 0.3:
        data = bytearray(path.read_bytes())
        for _ in range(rng.choice((1, 2, 8))):
            data[rng.randrange(len(data))] = rng.choice((0, 255, rng.randrange(256)))
        path.write_bytes(changed(bytes(data), rng) if rng.random() < 0.3 else data)
    return path


def _column(group: Any, name: str, rows: int, rng: random.Random, width: int = 0) -> None:
    """A data set; some has another type, another shape or another name, or claims more than the file can hold."""
    import h5py

    if rng.random() < 0.01:
        name = rng.choice(NAMES).strip(".") or name
    if name in group:
        return
    shape = (rows, width) if width else (rows,)
    values: Any = np.arange(float(np.prod(shape))).reshape(shape) % 7.0
    if name == "stamp":
        values = 1000.0 + 0.1 * values
    if values.size and rng.random() < 0.05:
        values.flat[rng.randrange(values.size)] = rng.choice(ODD_NUMBERS)
    options: dict[str, Any] = rng.choice(({}, {}, {"compression": "gzip"}, {"chunks": True, "shuffle": True}))
    if rng.random() > 0.03:
        group.create_dataset(name, data=values, **(options if values.size else {}))
        return
    what = rng.randrange(9)
    if what == 0:
        group[name] = values[:-1]
    elif what == 1:
        with np.errstate(invalid="ignore", over="ignore"):
            group[name] = values.astype(rng.choice(("f2", ">f4", "i1", "u8", "?", "c16", "S3")))
    elif what == 2:
        texts = [rng.choice((*NAMES, "1.5", "laser")) for _ in range(values.size)]
        group.create_dataset(name, data=np.array(texts, object).reshape(shape), dtype=h5py.string_dtype())
    elif what == 3:
        group[name] = h5py.Empty("f8")
    elif what == 4:
        group[name] = rng.choice((1.5, np.zeros((rows, 2, 2)), np.zeros((0, 3)), group.ref))
    elif what == 5:
        wide = rng.choice((10**3, 10**6, CLAIMED_BYTES // 8 // max(rows, 1)))
        group.create_dataset(name, (rows, wide), "f8", fillvalue=rng.choice((0.0, float("nan"))))
    elif what == 6:
        group.create_dataset(name, (rng.choice((10**6, 10**9)),), "f8", chunks=(10**3,), fillvalue=1.0)
    elif what == 7:
        group.create_dataset(
            name, (rows,), np.dtype([("x", "f8"), ("stamp", "f8"), ("deep", [("y", "i4")]), ("s", "S9")])
        )
    else:
        group.create_dataset(name, (rows,), h5py.vlen_dtype(np.int32))


def _attribute(group: Any, name: str, value: float, rng: random.Random) -> None:
    """A constant; some is a text, an array, odd, or missing."""
    import h5py

    if rng.random() < 0.03:
        odd = (*ODD_NUMBERS, "x", "1.5", b"2", np.zeros(3), h5py.Empty("f8"), group.ref, 1j, 2**62, True, "")
        value = rng.choice(odd)
    if rng.random() > 0.01:
        group.attrs[name] = value
    if rng.random() < 0.1:
        group.attrs[rng.choice(("frame", "time_increment", "stamp", *NAMES[1:]))] = rng.choice(
            ("laser", 1.5, value)
        )


def _link(file: Any, rng: random.Random) -> None:
    """A link to nowhere, out of the file, or back."""
    import h5py

    kind = rng.choice(sorted(set(CSV_KINDS) - set(file)))
    links = (
        h5py.SoftLink("/nowhere"), h5py.SoftLink("/scan"), h5py.ExternalLink("/dev/zero", "/"), file["scan"], file["/"],
    )  # fmt: skip
    if rng.random() < 0.5:
        file[kind] = rng.choice(links)
    else:
        file["scan/loop"] = rng.choice(links)
