from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.segments import BucketGrid, cast_segments, fill_buckets
from tests.reference.segment_casting import cast_one


def cast(
    segments: np.ndarray,
    rays: np.ndarray,
    max_range: float,
    moving: np.ndarray | None = None,
    circles: np.ndarray | None = None,
    size: float = 0.7,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    low = segments.reshape(-1, 2).min(axis=0) - 0.01
    rows, cols = (int(v) for v in ((segments.reshape(-1, 2).max(axis=0) + 0.01 - low) / size + 1)[::-1])
    grid = BucketGrid(float(low[0]), float(low[1]), size, rows, cols)
    moving = np.zeros((0, 4)) if moving is None else moving
    circles = np.zeros((0, 3)) if circles is None else circles
    starts, items = fill_buckets(segments, grid)
    return cast_segments(
        segments=segments,
        starts=starts,
        items=items,
        grid=grid,
        moving=moving,
        circles=circles,
        rays=rays,
        max_range=max_range,
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.3, 0.7, 5.0]))
def test_ranges_equal_those_of_testing_every_shape(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    segments, moving = rng.uniform(-4, 4, (30, 4)), rng.uniform(-4, 4, (4, 4))
    circles = np.column_stack([rng.uniform(-4, 4, (3, 2)), rng.uniform(0.05, 0.5, 3)])
    angle = rng.uniform(-np.pi, np.pi, 40)
    rays = np.column_stack([rng.uniform(-6, 6, (40, 2)), np.cos(angle), np.sin(angle)])
    ranges, _, _ = cast(segments, rays, 9.0, moving, circles, size)
    slow = [cast_one(np.concatenate([segments, moving]), circles, ray, 9.0) for ray in rays]
    assert np.allclose(ranges, slow, atol=1e-7)


def test_rays_along_the_axes_and_into_corners_do_not_slip_through() -> None:
    room = np.array([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]], float)
    targets = np.array([[4, 1], [2, 3], [0, 1], [2, 0], [0, 0], [4, 0], [4, 3], [0, 3]], float)
    offsets = targets - [2.0, 1.0]
    distance = np.hypot(*offsets.T)
    rays = np.column_stack([np.tile([2.0, 1.0], (8, 1)), offsets / distance[:, None]])
    ranges, hits, _ = cast(room, rays, 50.0)
    assert np.allclose(ranges, distance, atol=1e-12)
    assert (hits >= 0).all()


def test_the_shape_hit_and_the_angle_of_incidence_are_returned() -> None:
    wall, moving = np.array([[5.0, -5, 5, 5]]), np.array([[3.0, -1, 3, 1]])
    circles = np.array([[0.0, 4.0, 1.0]])
    half = np.sqrt(0.5)
    rays = np.array([[0, 0, 1, 0], [0, 0, half, half], [0, 0, 0, 1], [0, 0, -1, 0]], float)
    ranges, hits, cosines = cast(wall, rays, 20.0, moving, circles)
    assert hits.tolist() == [1, 0, 2, -1]
    assert np.allclose(ranges, [3.0, 5.0 / half, 3.0, 20.0])
    assert np.allclose(cosines, [1.0, half, 1.0, 1.0])
