"""What the fixed cameras say about poses: the environment weight (ispace-mcl, eqs. 5 - 7)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.kernel_density import kernel_density
from gridslam.filters.particles import Particles
from gridslam.filters.resampling import systematic_resampling
from gridslam.maps.distances import distances_to
from gridslam.methods.ispace_mcl.camera_config import CamerasConfig, DensityConfig, SightingConfig
from gridslam.sensors.fixed_camera import Sighting

Floats = NDArray[np.float64]

_FAR = 4.0  # bandwidths: farther away nothing is near
_SMALLEST = 1e-300
_MOST_PLACES, _HEADINGS = 60, 60
_SAME_M = 0.05  # frames between which the robot moves less are of one moment
_SCATTER = np.array([0.15, 0.15, 0.05])  # of proposals: m, m, rad


@dataclass(frozen=True, slots=True)
class Frame:
    """What a camera says at a moment: centres of floor cells above which something moves `(k, 2)`, and of those in view `(m, 2)`.

    `back` is T_now_then `(3,)`: the robot at the frame's stamp seen from where it is now.
    """

    moving: Floats
    in_view: Floats
    back: Floats


def moving_cells(sighting: Sighting, cell_m: float, least_area_m2: float) -> Floats:
    """Centres `(k, 2)` of the floor cells above which enough surface moves, in the order of x, then y."""
    if not len(sighting.points):
        return np.zeros((0, 2))
    cells = np.floor(sighting.points / cell_m).astype(np.int64)
    first = cells.min(axis=0)
    width, height = (cells.max(axis=0) - first + 1).tolist()
    member = (cells[:, 0] - first[0]) * height + cells[:, 1] - first[1]
    area = np.bincount(member, sighting.areas_m2, width * height).reshape(width, height)
    return np.asarray((np.argwhere(area >= max(least_area_m2, _SMALLEST)) + first + 0.5) * cell_m)


def all_moving(frames: Sequence[Frame]) -> Floats:
    """Centres `(k, 2)` of the floor cells above which any of the cameras sees something move."""
    return np.concatenate([*(f.moving for f in frames), np.zeros((0, 2))])


def places_then(backs: Sequence[Floats], poses: Floats) -> Iterator[Floats]:
    """Where robots that are at poses `(n, 3)` now were at each of some moments, `(n, 2)`; `backs` are T_now_then."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    for back in backs:
        dx, dy = float(back[0]), float(back[1])
        yield np.column_stack([poses[:, 0] + cos * dx - sin * dy, poses[:, 1] + sin * dx + cos * dy])


class SightingWeight:
    """Log-likelihoods of poses relative to a robot that no camera sees (see SightingConfig)."""

    def __init__(self, config: CamerasConfig, weight: SightingConfig) -> None:
        self._config = config
        self._weight = weight

    def log_likelihood(self, frames: Sequence[Frame], poses: Floats) -> Floats:
        """Of poses `(n, 3)`: `(n,)`."""
        total, w = np.zeros(len(poses)), self._weight
        density = 1.0 / (w.clutter_per_m2 * 2.0 * np.pi * w.bandwidth_m**2)
        backs = [frame.back for frame in frames]
        for frame, places in zip(frames, places_then(backs, poses), strict=True):
            in_view = in_cells(frame.in_view, places, self._config.cell_m)
            near = self._nearness(frame.moving, places)
            ratio = np.where(in_view, 1.0 - w.detection, 1.0 - w.detection * near)
            total += np.log(ratio + w.detection * density * near)
        return w.frame_weight * total

    def _nearness(self, moving: Floats, places: Floats) -> Floats:
        """exp(-d^2 / 2 h^2) `(n,)` for the distance d to the nearest thing that moves, less the robot's own radius."""
        w = self._weight
        distance = distance_to(moving, places, self._config.cell_m, w.radius_m + _FAR * w.bandwidth_m)
        return np.asarray(np.exp(-0.5 * (np.maximum(distance - w.radius_m, 0.0) / w.bandwidth_m) ** 2))


def proposals(
    places: Floats,
    log_weight: Callable[[Floats], Floats],
    count: int,
    rng: np.random.Generator,
) -> Floats | None:
    """Poses `(count, 3)` about the places `(k, 2)` of what moves, with headings that the onboard sensor agrees with.

    None where nothing moves.

    `log_weight` is the onboard log-weight of poses `(n, 3)`.
    """
    if not len(places):
        return None
    places = places[
        (np.arange(min(len(places), _MOST_PLACES)) * len(places)) // min(len(places), _MOST_PLACES)
    ]
    headings = np.linspace(-np.pi, np.pi, _HEADINGS, endpoint=False)
    poses = np.column_stack([np.repeat(places, _HEADINGS, axis=0), np.tile(headings, len(places))])
    score = log_weight(poses)
    share = np.exp(score - score.max())
    members = systematic_resampling(share / share.sum(), count, rng)
    drawn: Floats = poses[members] + rng.standard_normal((count, 3)) * _SCATTER
    drawn[:, 2] = se2.wrap_angle(drawn[:, 2])
    return drawn


class DensityWeight:
    """The paper's own: w = eta P_onboard(x) P_iSpace(x), the second a kernel density over the floor cells that move (eqs. 5 - 7).

    `onboard: kernel` takes P_onboard(x) from a kernel density of the onboard-weighted particles, as the equation reads. But the
    particles stand for that density already, and weights by it square it: the largest cluster soon is the only one.
    `onboard: particles` multiplies the onboard weights by P_iSpace, so that the particles stand for the product.
    """

    def __init__(self, weight: DensityConfig) -> None:
        self._weight = weight

    def reweighted(self, frames: Sequence[Frame], particles: Particles) -> Particles:
        """Particles with the weights of both densities; unchanged where no foreground is seen, or none near a particle."""
        bandwidth = self._weight.bandwidth_m
        moments = [(back, cells) for back, cells in by_moment(frames) if len(cells)]
        if not moments:
            return particles
        onboard = particles.weights
        if self._weight.onboard == "kernel":
            here = particles.poses[:, :2]
            onboard = kernel_density(here, particles.weights, bandwidth).at(here)
        environment = np.zeros(len(particles))
        backs = [back for back, _ in moments]
        for (_, cells), places in zip(moments, places_then(backs, particles.poses), strict=True):
            environment += len(cells) * kernel_density(cells, np.ones(len(cells)), bandwidth).at(places)
        weights = onboard * environment
        total = weights.sum()
        if not total > _SMALLEST:
            return particles
        return Particles(particles.poses, weights / total)


def by_moment(frames: Sequence[Frame]) -> list[tuple[Floats, Floats]]:
    """T_now_then of each moment, and what moves in all of its frames together, `(k, 2)`."""
    groups: dict[tuple[int, int], list[Frame]] = {}
    for frame in frames:
        x, y = np.rint(frame.back[:2] / _SAME_M).astype(int).tolist()
        groups.setdefault((x, y), []).append(frame)
    return [
        (group[0].back, np.unique(np.concatenate([f.moving for f in group]), axis=0))
        for group in groups.values()
    ]


def in_cells(cells: Floats, places: Floats, cell_m: float) -> NDArray[np.bool_]:
    """Whether places `(n, 2)` lie in one of the cells with these centres `(k, 2)`."""
    if not len(cells):
        return np.zeros(len(places), np.bool_)
    grid, origin = _raster(cells, cell_m, 0)
    index, inside = _indices(places, origin, cell_m, grid.shape)
    return np.asarray(inside & (grid[index[:, 1], index[:, 0]] == 0))


def distance_to(cells: Floats, places: Floats, cell_m: float, reach_m: float) -> Floats:
    """Distance `(n,)` of places to the nearest of the cells `(k, 2)`, at most `reach_m`; exact to half a cell."""
    if not len(cells):
        return np.full(len(places), reach_m)
    grid, origin = _raster(cells, cell_m, int(np.ceil(reach_m / cell_m)))
    distances = distances_to(grid == 0) * cell_m
    index, inside = _indices(places, origin, cell_m, grid.shape)
    return np.where(inside, np.minimum(distances[index[:, 1], index[:, 0]], reach_m), reach_m)


def _raster(cells: Floats, cell_m: float, margin: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """A grid that is 0 in the cells and 1 elsewhere, and the index (x, y) of its first cell."""
    index = np.floor(cells / cell_m).astype(np.int64)
    origin = index.min(axis=0) - margin
    cols, rows = (index.max(axis=0) + margin + 1 - origin).tolist()
    grid = np.ones((rows, cols), np.uint8)
    grid[index[:, 1] - origin[1], index[:, 0] - origin[0]] = 0
    return grid, origin


def _indices(
    places: Floats, origin: NDArray[np.int64], cell_m: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Columns and rows `(n, 2)` of places in a raster, 0 where they lie outside, and whether they lie inside."""
    index = np.floor(places / cell_m).astype(np.int64) - origin
    inside = (index >= 0).all(axis=1) & (index[:, 0] < shape[1]) & (index[:, 1] < shape[0])
    return np.where(inside[:, None], index, 0), inside
