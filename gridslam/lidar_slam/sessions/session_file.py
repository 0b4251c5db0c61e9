"""session.npz: a session as plain arrays with a version and a digest, whose every bound is checked when it is read."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import InputError
from gridslam.core.numpy_files import npz_bytes, read_npz
from gridslam.core.plain_files import read_plain_file
from gridslam.core.texts import is_storable
from gridslam.lidar_slam.sessions.drawn_file import MAX_CELLS as MAX_DRAWN_CELLS
from gridslam.lidar_slam.sessions.drawn_file import SCHEMA as DRAWN_SCHEMA
from gridslam.lidar_slam.sessions.drawn_file import frame_document
from gridslam.lidar_slam.sessions.object_records import SCHEMA as OBJECT_SCHEMA
from gridslam.lidar_slam.sessions.session import Session
from gridslam.lidar_slam.sessions.session_arrays import arrays_of, session_of
from gridslam.lidar_slam.sessions.session_checks import SCHEMA, SWAY_SCHEMA, Arrays, check_arrays

FILE_NAME = "session.npz"
DIGEST = "digest"  # name of the array with the SHA-256 of all others
ZIP_MAGIC = b"PK"
FORMAT, VERSION = "gridslam session", 4
MAX_FILE_BYTES = MAX_UNPACKED_BYTES = 1 << 28  # without the points, which are unpacked when they are needed
MAX_HEAD_BYTES = 1 << 22
MIN_KEY_BYTES = 50  # smallest size of a key scan in the file, of which the poses alone take more


def session_bytes(session: Session) -> bytes:
    """The content of session.npz; the same session gives the same bytes."""
    if session.drawn is not None and session.drawn.log_odds.size > MAX_DRAWN_CELLS:
        session = replace(session, drawn=None)  # a session without it is drawn again from its scans
    arrays = chain([("head", _head_of(session))], arrays_of(session))
    return npz_bytes(with_digest(arrays), stored=("points",))


def with_digest(arrays: Iterable[tuple[str, NDArray[Any]]]) -> Iterator[tuple[str, NDArray[Any]]]:
    """The pairs (name, array), and at the end the array `digest`, which shows whether the others were changed later."""
    digests = {}
    for name, values in arrays:
        digests[name] = _digest_of(values)
        yield name, values
    yield DIGEST, np.frombuffer(bytes.fromhex(_digest_of_all(digests)), np.uint8)


def _digest_of(values: NDArray[Any]) -> str:
    """The digest of an array: its type, shape and content."""
    digest = hashlib.sha256(f"{values.dtype.str} {values.shape}".encode())
    is_plain = values.dtype.kind in "biuf"  # always so in files that gridslam wrote
    digest.update(
        np.ascontiguousarray(values).reshape(-1).view(np.uint8).data if is_plain else values.tobytes()
    )
    return digest.hexdigest()


def _digest_of_all(digests: dict[str, str]) -> str:
    """The digest of the arrays' digests by name."""
    return hashlib.sha256(json.dumps(digests, sort_keys=True).encode()).hexdigest()


def load_session(path: Path) -> Session:
    """The session that a run wrote. Raises InputError: the file cannot be read, is damaged, or has another version."""
    try:
        return read_session(read_plain_file(path, MAX_FILE_BYTES), str(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def read_session(content: bytes, name: str) -> Session:
    """The session in a file's content. Raises InputError, which names the file: it is damaged, or has another version."""
    if not content.startswith(ZIP_MAGIC):
        raise InputError(f"{name}: not a session; give the {FILE_NAME} of a run, or the directory of the run")
    try:
        arrays = read_npz(io.BytesIO(content), MAX_UNPACKED_BYTES)
        head = _checked_head(arrays.get("head"))
        _check_digest(arrays)
        optional = {
            **(DRAWN_SCHEMA if head["drawn"] else {}),
            **(SWAY_SCHEMA if "scan.swing" in arrays else {}),
        }
        check_arrays(arrays, {**SCHEMA, **OBJECT_SCHEMA, **optional})
        if MIN_KEY_BYTES * len(arrays["key.pose"]) > len(content):
            raise ValueError(f"it claims to hold {len(arrays['key.pose'])} key scans in {len(content)} bytes")
        if len(head["logs"]) != len(arrays["drive.keys"]):
            raise ValueError("a drive has no log")
        return session_of(arrays, head["logs"], object_ids=head["objects"], drawn_frame=head["drawn"])
    except ValueError as error:
        raise InputError(
            f"{name}: not a session that can be continued: {error}; map its logs again"
        ) from None


def _check_digest(arrays: Arrays) -> None:
    """Raises ValueError: the arrays are not those that were written."""
    stored = arrays.pop(DIGEST, np.zeros(0, np.uint8))
    if stored.tobytes().hex() != _digest_of_all(
        {name: _digest_of(values) for name, values in arrays.items()}
    ):
        raise ValueError("its content was changed after it was written")


def _head_of(session: Session) -> NDArray[np.uint8]:
    """The head: a JSON document of all that is not an array."""
    head = {
        "format": FORMAT,
        "version": VERSION,
        "logs": [drive.log for drive in session.drives],
        "objects": list(session.objects.ids),
        "drawn": None if session.drawn is None else frame_document(session.drawn.frame),
    }
    return np.frombuffer(json.dumps(head).encode(), np.uint8)


def _checked_head(head: NDArray[np.generic] | None) -> dict[str, Any]:
    """The head's `logs` (names), `objects` (ids of all estimates), and `drawn` (frame of the drawn map, or None).

    Raises ValueError: it is damaged, or of another format or version. The frame is not checked.
    """
    try:
        if head is None or head.dtype != np.uint8 or head.size > MAX_HEAD_BYTES:
            raise ValueError
        document = json.loads(head.tobytes())
        kind, version, logs = document["format"], document["version"], document["logs"]
        objects, drawn = document.get("objects"), document.get("drawn")
    except (ValueError, TypeError, KeyError, RecursionError):
        raise ValueError("it has no readable head") from None
    if kind != FORMAT:
        raise ValueError("it is another kind of file")
    if version != VERSION:
        raise ValueError(f"version {repr(version)[:20]}, this program reads version {VERSION}")
    for names in (logs, objects):
        if not isinstance(names, list) or not all(
            isinstance(name, str) and is_storable(name) for name in names
        ):
            raise ValueError("its logs or objects have no names that can be written")
    return {"logs": logs, "objects": objects, "drawn": drawn}
