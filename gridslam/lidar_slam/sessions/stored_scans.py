"""Key scans of a drive as session.npz keeps them: compressed, some tens together, and unpacked when they are read.

A drive that goes on from many earlier ones so neither unpacks nor packs the scans that it does not need.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import InputError
from gridslam.core.numpy_files import COMPRESSION_LEVEL
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHUNK_SCANS = 64  # packed together: some 15 m of a path
POINT_UNIT_M = 2.0**-10  # coordinates of points are whole numbers of it
NORMAL_UNIT_RAD = 1e-4
MAX_ANGLE = int(np.pi / NORMAL_UNIT_RAD)
NO_NORMAL = np.int16(-32768)
MAX_POINT_M = 1000.0
RETURN_BYTES, SURFACE_BYTES = 8, 10  # size of an unpacked point


class StoredScans(Sequence[PreparedScan]):
    """Scans of which stamps, viewpoints `(k, 2)` and numbers of points `(k,)` are at hand, and the points are packed.

    Their surfaces stand for the points that are matched: a key scan of a session is matched as part of a map only.
    Reading one raises InputError if its points are damaged.
    """

    def __init__(
        self,
        stamps_ns: Ints,
        viewpoints: Floats,
        counts: tuple[Ints, Ints],
        chunks: Sequence[bytes | memoryview],
    ) -> None:
        """`counts` are the numbers of returns and of points of the surface of each scan."""
        self.stamps_ns, self.viewpoints, self.counts, self.chunks = stamps_ns, viewpoints, counts, chunks
        self._unpacked: tuple[int, list[PreparedScan]] = -1, []

    @staticmethod
    def of(scans: Sequence[PreparedScan]) -> StoredScans:
        """The scans packed; those that are already packed as they are."""
        if isinstance(scans, StoredScans):
            return scans
        stamps, viewpoints, returns, surfaces, chunks = [], [], [], [], []
        for first in range(0, len(scans), CHUNK_SCANS):
            own = scans[first : first + CHUNK_SCANS]
            stamps += [scan.stamp_ns for scan in own]
            viewpoints += [scan.viewpoint for scan in own]
            returns += [len(scan.returns) for scan in own]
            surfaces += [len(scan.surface) for scan in own]
            chunks.append(_packed(own))
        counts = np.array(returns, np.int64), np.array(surfaces, np.int64)
        return StoredScans(np.array(stamps, np.int64), np.array(viewpoints).reshape(-1, 2), counts, chunks)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @overload
    def __getitem__(self, index: int) -> PreparedScan: ...

    @overload
    def __getitem__(self, index: slice) -> list[PreparedScan]: ...

    def __getitem__(self, index: int | slice) -> PreparedScan | list[PreparedScan]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        chunk, at = divmod(index % len(self), CHUNK_SCANS)
        if self._unpacked[0] != chunk:
            self._unpacked = chunk, self._unpack(chunk)
        return self._unpacked[1][at]

    def __iter__(self) -> Iterator[PreparedScan]:
        for chunk in range(len(self.chunks)):
            yield from self._unpack(chunk)

    def without_points(self, index: int) -> PreparedScan:
        """A scan as if it had seen nothing; nothing is unpacked."""
        return empty_scan(int(self.stamps_ns[index]), self.viewpoints[index])

    def _unpack(self, chunk: int) -> list[PreparedScan]:
        rows = slice(CHUNK_SCANS * chunk, CHUNK_SCANS * (chunk + 1))
        returns, surfaces = (count[rows] for count in self.counts)
        try:
            points = _points_in(self.chunks[chunk], int(returns.sum()), int(surfaces.sum()))
        except (ValueError, zlib.error):
            raise InputError("the session's scans are damaged; map its logs again") from None
        ends, surface_ends = np.cumsum(returns), np.cumsum(surfaces)
        return [
            _scan(stamp, viewpoint, points, (slice(end - n, end), slice(s_end - s, s_end)))
            for stamp, viewpoint, n, end, s, s_end in zip(
                self.stamps_ns[rows].tolist(),
                self.viewpoints[rows],
                returns.tolist(),
                ends.tolist(),
                surfaces.tolist(),
                surface_ends.tolist(),
                strict=True,
            )
        ]


def empty_scan(stamp_ns: int, viewpoint: Floats) -> PreparedScan:
    """A scan without points, from a viewpoint (2,) in the robot's frame."""
    none = np.zeros((0, 2))
    return PreparedScan(
        stamp_ns, viewpoint, none, points=none, normals=none, surface=none, surface_normals=none
    )


def _scan(
    stamp_ns: int, viewpoint: Floats, points: tuple[Floats, Floats, Floats], rows: tuple[slice, slice]
) -> PreparedScan:
    """A scan by its rows of the returns, and of the surface and its normals."""
    returns, surface, normals = points
    own, own_normals = surface[rows[1]], normals[rows[1]]
    return PreparedScan(
        stamp_ns,
        viewpoint,
        returns[rows[0]],
        points=own,
        normals=own_normals,
        surface=own,
        surface_normals=own_normals,
    )


def _packed(scans: Sequence[PreparedScan]) -> bytes:
    """The points of some scans: differences of whole numbers, which compress well."""
    parts = [
        _differences(np.concatenate([scan.returns for scan in scans])).tobytes(),
        _differences(np.concatenate([scan.surface for scan in scans])).tobytes(),
        _packed_normals(np.concatenate([scan.surface_normals for scan in scans])).tobytes(),
    ]
    return zlib.compress(b"".join(parts), COMPRESSION_LEVEL)


def _points_in(content: bytes | memoryview, returns: int, surfaces: int) -> tuple[Floats, Floats, Floats]:
    """Returns, surface and its normals. Raises ValueError, zlib.error: another number of points is packed there."""
    size = RETURN_BYTES * returns + SURFACE_BYTES * surfaces
    unpacking = zlib.decompressobj()
    data = unpacking.decompress(content, size + 1)
    if len(data) != size:
        raise ValueError("another number of points")
    whole = np.frombuffer(data, "<i4", 2 * (returns + surfaces)).reshape(-1, 2)
    angles = np.frombuffer(data, "<i2", surfaces, offset=RETURN_BYTES * (returns + surfaces))
    return _points(whole[:returns]), _points(whole[returns:]), _normals(angles)


def _differences(points: Floats) -> NDArray[np.int32]:
    whole = np.rint(points / POINT_UNIT_M).astype(np.int32)
    return np.diff(whole, axis=0, prepend=np.zeros((1, 2), np.int32)).astype("<i4")


def _points(differences: NDArray[np.int32]) -> Floats:
    whole = np.cumsum(differences, axis=0, dtype=np.int64)
    if np.abs(whole).max(initial=0) > MAX_POINT_M / POINT_UNIT_M:
        raise ValueError("a point is out of range")
    return np.asarray(whole * POINT_UNIT_M, np.float64)


def _packed_normals(normals: Floats) -> NDArray[np.int16]:
    angle = np.rint(np.arctan2(normals[:, 1], normals[:, 0]) / NORMAL_UNIT_RAD)
    angle = np.clip(angle, -MAX_ANGLE, MAX_ANGLE)  # a little beyond pi would be read as another angle
    return np.where(normals.any(axis=1), angle, NO_NORMAL).astype("<i2")


def _normals(angles: NDArray[np.int16]) -> Floats:
    angle = angles * NORMAL_UNIT_RAD
    is_known = (angles != NO_NORMAL)[:, None]
    return np.asarray(np.where(is_known, np.stack([np.cos(angle), np.sin(angle)], axis=1), 0.0), np.float64)
