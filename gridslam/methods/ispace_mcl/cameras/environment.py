"""Weights of poses by the observations of fixed cameras: the environment weight (ispace-mcl, eqs. 5 - 7)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.kernel_density import kernel_density
from gridslam.filters.particles import Particles
from gridslam.maps.distances import distances_to
from gridslam.sensors.fixed_camera import FloorDetections
from gridslam.sensors.floor_cells import FloorCells

Floats = NDArray[np.float64]

_CUTOFF = 4.0  # bandwidths: beyond them the kernel is taken as 0
_FAR = 1e-3  # nearness below which the past of an object does not matter
_PAST_CUTOFF_M = 2.0  # distance at which an object's past position cannot be the robot's
# That a track changed from a person to the robot: one hides behind the other, or leaves the view ...
_EXCHANGED = 0.1
# ... which each frame since then makes likelier, in which it agrees with the robot's path
_EXCHANGED_GROWTH = 2.0
_MIN_WEIGHT = 1e-300
_SAME_MOMENT_M = 0.05  # frames between which the robot moves less are taken as simultaneous
DENSITY_BANDWIDTH_M = 0.5  # kernel of the paper's densities; smaller ones lose the robot in a missed frame


@dataclass(frozen=True, slots=True)
class DetectionLikelihood:
    """Parameters of the likelihood of detections.

    A pose is scored relative to a robot out of view: 1 - detection + detection N(d) / clutter_per_m2 where it would be visible,
    d being its distance to the nearest moving object; 1 where it would not be visible. So a pose that no camera sees is neither
    favoured nor rejected.
    """

    bandwidth_m: float = 0.3  # standard deviation of a detection's position
    radius_m: float = 0.15  # an object nearer than this to a pose may be the robot's own surface
    past_bandwidth_m: float = 0.2  # standard deviation of a track about the robot's path
    detection: float = 0.85  # probability that a robot in view is detected
    clutter_per_m2: float = 0.1  # people expected per square metre
    tracked_per_m2: float = (
        0.4  # the same where a tracked object is expected: a person walks on as steadily as a robot
    )
    frame_weight: float = 0.5  # power of a frame's likelihood: simultaneous frames have common errors


@dataclass(frozen=True, slots=True)
class ObservedTrack:
    """A moving object of a frame: its floor cells, and those of the same object in earlier frames, latest first, each with the
    robot's pose T_now_then `(3,)` at that frame.

    `was_expected`: an object was near by in the frame before, which may have been another one if there is no past.
    """

    moving: FloorCells
    past: tuple[tuple[Floats, FloorCells], ...] = ()
    was_expected: bool = False


@dataclass(frozen=True, slots=True)
class CameraObservation:
    """One camera frame for a scan: the floor cells in which something moves, and all that are visible.

    `T_now_then` `(3,)` is the robot's pose at the frame's stamp relative to its pose at the scan.
    """

    moving: FloorCells
    in_view: FloorCells
    T_now_then: Floats
    tracks: tuple[ObservedTrack, ...] = ()

    def seen_after(self, step: Floats) -> CameraObservation:
        """The observation for a later scan, to which the robot came by the motion `step` `(3,)`."""
        back = se2.inverse(step)
        tracks = tuple(
            replace(t, past=tuple((se2.compose(back, then), cells) for then, cells in t.past))
            for t in self.tracks
        )
        return CameraObservation(self.moving, self.in_view, se2.compose(back, self.T_now_then), tracks)


def moving_cells(detections: FloorDetections, cell_m: float, min_area_m2: float) -> FloorCells:
    """The floor cells with at least `min_area_m2` of moving surface, sorted by x, then y."""
    cells = FloorCells.containing(detections.points, cell_m).index
    if not len(cells):
        return FloorCells(cells, cell_m)
    first = cells.min(axis=0)
    width, height = (cells.max(axis=0) - first + 1).tolist()
    member = (cells[:, 0] - first[0]) * height + cells[:, 1] - first[1]
    area = np.bincount(member, detections.areas_m2, width * height).reshape(width, height)
    return FloorCells(np.argwhere(area >= max(min_area_m2, _MIN_WEIGHT)) + first, cell_m)


def all_moving(observations: Sequence[CameraObservation]) -> Floats:
    """Centres `(k, 2)` of the moving floor cells of all observations."""
    return np.concatenate([*(o.moving.centres for o in observations), np.zeros((0, 2))])


def past_positions(transforms: Sequence[Floats], poses: Floats) -> Iterator[Floats]:
    """Positions `(n, 2)` in the past of robots with poses `(n, 3)` now, for each of the transforms T_now_then `(3,)`."""
    (x, y), cos, sin = poses[:, :2].T.copy(), np.cos(poses[:, 2]), np.sin(poses[:, 2])
    for T_now_then in transforms:
        dx, dy = float(T_now_then[0]), float(T_now_then[1])
        yield np.stack([x + cos * dx - sin * dy, y + sin * dx + cos * dy]).T


class DetectionWeight:
    """Log-likelihoods of poses relative to a robot that no camera sees."""

    def __init__(self, likelihood: DetectionLikelihood = DetectionLikelihood()) -> None:
        self._likelihood = likelihood

    def log_likelihood(self, observations: Sequence[CameraObservation], poses: Floats) -> Floats:
        """Log-likelihoods `(n,)` of poses `(n, 3)`, summed over the observations."""
        total, p = np.zeros(len(poses)), self._likelihood
        transforms = [observation.T_now_then for observation in observations]
        for observation, positions in zip(observations, past_positions(transforms, poses), strict=True):
            in_view = is_in_cells(observation.in_view, positions)
            near, gain = self._detections_near(observation, positions, poses)
            ratio = np.where(in_view, 1.0 - p.detection, 1.0 - p.detection * near)
            total += np.log(ratio + p.detection * gain)
        return p.frame_weight * total

    def _detections_near(
        self, observation: CameraObservation, positions: Floats, poses: Floats
    ) -> tuple[Floats, Floats]:
        """Proximity `(n,)` of positions `(n, 2)` to the moving objects, and N(d) / clutter `(n,)` of the object that agrees
        best, for robots with poses `(n, 3)` now.

        An object counts as far as its past agrees with the robot's own path: it is a person if it moves otherwise. One that has
        a past was to be expected near by, robot or not, so that it says less.
        """
        p = self._likelihood
        nearest, best = np.zeros((2, len(positions)))
        for track in observation.tracks or (ObservedTrack(observation.moving),):
            near = self._nearness(track.moving, positions)
            clutter_per_m2 = p.tracked_per_m2 if track.was_expected else p.clutter_per_m2
            if track.past:
                is_near = np.flatnonzero(near > _FAR)
                near[is_near] *= self._agreement(track, poses[is_near])
            nearest = np.maximum(nearest, near)
            best = np.maximum(best, near / (clutter_per_m2 * 2.0 * np.pi * p.bandwidth_m**2))
        return nearest, best

    def _agreement(self, track: ObservedTrack, poses: Floats) -> Floats:
        """Agreement `(n,)`, 0 to 1, of an object's past with the paths of robots that are at poses `(n, 3)` now.

        The track may have been a person's until some frames ago: then only its past since then counts, for less.
        """
        p = self._likelihood
        squares, best = np.zeros((2, len(poses)))
        transforms = [T_now_then for T_now_then, _ in track.past]
        since = past_positions(transforms, poses)
        for frames, ((_, cells), then) in enumerate(zip(track.past, since, strict=True)):
            agreement = np.exp(-0.5 * squares / (max(frames, 1) * p.past_bandwidth_m**2))
            best = np.maximum(best, agreement * min(_EXCHANGED * _EXCHANGED_GROWTH**frames, 1.0))
            distance = distance_to_cells(cells, then, p.radius_m + _PAST_CUTOFF_M)
            squares += np.maximum(distance - p.radius_m, 0.0) ** 2
        return np.maximum(best, np.exp(-0.5 * squares / (len(track.past) * p.past_bandwidth_m**2)))

    def _nearness(self, moving: FloorCells, positions: Floats) -> Floats:
        """exp(-d^2 / 2 h^2) `(n,)` for the distance d to the nearest moving cell, less the robot's own radius."""
        p = self._likelihood
        max_distance_m = p.radius_m + _CUTOFF * p.bandwidth_m
        distance = distance_to_cells(moving, positions, max_distance_m)
        return np.asarray(np.exp(-0.5 * (np.maximum(distance - p.radius_m, 0.0) / p.bandwidth_m) ** 2))


class DensityWeight:
    """The paper's weight w = eta P_onboard(x) P_iSpace(x); P_iSpace is a kernel density over the moving floor cells (eqs. 5 - 7).

    By default the onboard weights are multiplied by P_iSpace, so that the particles represent the product of both densities. With
    `as_printed`, P_onboard is a kernel density of the onboard-weighted particles, as the equation reads. The particles represent
    that density already; weights by it square it, and the largest cluster soon is the only one.
    """

    def __init__(self, as_printed: bool, bandwidth_m: float = DENSITY_BANDWIDTH_M) -> None:
        self._as_printed = as_printed
        self._bandwidth_m = bandwidth_m

    def reweighted(self, observations: Sequence[CameraObservation], particles: Particles) -> Particles:
        """Particles weighted by both densities; unchanged if no cell moves, or none near a particle."""
        bandwidth = self._bandwidth_m
        moments = [moment for moment in by_moment(observations) if len(moment[1])]
        if not moments:
            return particles
        onboard = particles.weights
        if self._as_printed:
            positions = particles.poses[:, :2]
            onboard = kernel_density(positions, particles.weights, bandwidth).at(positions)
        environment = np.zeros(len(particles))
        transforms = [T_now_then for T_now_then, _ in moments]
        for (_, cells), then in zip(moments, past_positions(transforms, particles.poses), strict=True):
            environment += len(cells) * kernel_density(cells, np.ones(len(cells)), bandwidth).at(then)
        weights = onboard * environment
        total = weights.sum()
        if not total > _MIN_WEIGHT:
            return particles
        return Particles(particles.poses, weights / total)


def by_moment(observations: Sequence[CameraObservation]) -> list[tuple[Floats, Floats]]:
    """Simultaneous observations joined: T_now_then `(3,)` and the centres `(k, 2)` of the moving cells of each moment."""
    groups: dict[tuple[int, int], list[CameraObservation]] = {}
    for observation in observations:
        x, y = np.rint(observation.T_now_then[:2] / _SAME_MOMENT_M).astype(int).tolist()
        groups.setdefault((x, y), []).append(observation)
    return [
        (
            group[0].T_now_then,
            FloorCells.joined([o.moving for o in group], group[0].moving.size_m).unique().centres,
        )
        for group in groups.values()
    ]


def is_in_cells(cells: FloorCells, positions: Floats) -> NDArray[np.bool_]:
    """Mask `(n,)` of the positions `(n, 2)` that lie in one of the cells."""
    if not len(cells):
        return np.zeros(len(positions), np.bool_)
    grid, origin = _raster(cells, 1)
    return np.asarray((grid == 0)[_nearest_cell(positions, origin, cells.size_m, grid.shape)])


def distance_to_cells(cells: FloorCells, positions: Floats, max_distance_m: float) -> Floats:
    """Distances `(n,)` of positions `(n, 2)` to the nearest of the cells, at most the maximum; exact to half a cell."""
    if not len(cells):
        return np.full(len(positions), max_distance_m)
    grid, origin = _raster(cells, int(np.ceil(max_distance_m / cells.size_m)))
    distances = np.minimum(distances_to(grid == 0) * cells.size_m, max_distance_m)
    return np.asarray(distances[_nearest_cell(positions, origin, cells.size_m, grid.shape)])


def _raster(cells: FloorCells, margin: int) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """A grid that is 0 at the cells and 1 elsewhere, with a margin of cells, and the index (x, y) of its first cell."""
    index = cells.index
    origin = index.min(axis=0) - margin
    cols, rows = (index.max(axis=0) + margin + 1 - origin).tolist()
    grid = np.ones((rows, cols), np.uint8)
    grid[index[:, 1] - origin[1], index[:, 0] - origin[0]] = 0
    return grid, origin


def _nearest_cell(
    positions: Floats, origin: NDArray[np.int64], cell_m: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column `(n,)` of positions in a raster; of those outside of it, the cell of its border that is nearest.

    Column by column: numpy is several times slower along an axis of two.
    """
    row, col = (
        np.clip(np.floor(positions[:, axis] / cell_m) - origin[axis], 0, size - 1).astype(np.int64)
        for axis, size in ((1, shape[0]), (0, shape[1]))
    )
    return row, col
