"""Monte Carlo localization over places: hypotheses of where the robot is in the drawing, and of how large things are drawn there.

A particle is a hypothesis for all places of the drive so far, a metre apart, each with a rotation and two scales of its own. A
place is predicted from the one that it was entered from, and is weighed once, by what is visible from there and by the walls
between it and its neighbours. So wings may be drawn at different scales, a room that is not drawn does not mislead what follows
it, and the robot is localized where it was when it returns. It is the search of `warp.search`, place by place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.filters.resampling import systematic_resampling
from gridslam.kernels.drawings.stretched_places import PlacePoints, normal_equations
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.localizer import (
    RESAMPLE_BELOW,
    DrawingBelief,
    DrawingLocalizer,
    belief_of,
)
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import (
    BEAMS,
    EDGE_M,
    MAX_UNKNOWN_M,
    SPACING_M,
    VIEW_M,
    open_points,
)
from gridslam.methods.handmap_slam.warp.refinement import WALL_WEIGHT, sloped_field
from gridslam.methods.handmap_slam.warp.search import (
    CAREFUL,
    CROSSED,
    SCALE_BOUND,
    SCALE_BOUND_WEIGHT,
    THINNED,
    loop_likelihood,
    predict_place,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEW_PLACE_M = 0.8  # distance from the nearest visible place at which the robot is at a new one
# Particles are resampled with this power of their weights, and keep the rest as weights: so a hypothesis that is less probable
# for a while, because a part of the drawing is wrong, goes on.
RESAMPLED_POWER = 0.5
REFINED_POINTS = 90  # number of points of a scan in the refinement of the pose
REFINEMENTS = 4
BELIEF_PARTICLES = 1000  # number of particles among which the heaviest cluster is sought at each scan
# Of the particles' belief in the refinement: metres, rad, log scales.
MIN_STD = np.array([0.1, 0.1, 0.03, 0.03, 0.03])


class PlaceLocalizer:
    """The places so far, and particles with a state `(5,)` of each: x, y, rotation of the start's frame, log scales."""

    def __init__(self, config: HandmapSlamConfig, drawn: DrawnMap, rng: np.random.Generator) -> None:
        self._rng = rng
        self._start = DrawingLocalizer(config, drawn, rng)
        self._evidence = DrawnEvidence(drawn)
        self._likelihood = DrawnLikelihood(drawn, config.localization.sigma_m)
        self._walls = sloped_field(self._evidence.to_wall)
        self._sigma_m = config.localization.sigma_m
        self._particles = config.localization.particles
        self._log_weights = np.zeros(self._particles)
        self._pose = np.zeros(3)  # of the robot, in the frame of its first pose
        self._centres = np.zeros((0, 2))
        self._drawn: list[Floats] = []  # states of each place as they were drawn
        self._ancestors: list[Ints] = []  # and of the particles of now among them
        self._here = 0
        self._first_scales = np.zeros(2)

    @property
    def states(self) -> Floats:
        """The robot's states `(n, 5)`: x, y (drawing units), yaw, log scales."""
        return self._robot_states(np.arange(self._particles)) if self._drawn else self._start.states

    def start(self, points: Floats) -> DrawingBelief:
        """Estimate pose and scale from the points `(m, 2)` of the first scan."""
        belief = self._start.start(points)
        self._first_scales = self._start.states[:, 3:].mean(axis=0)
        self._append(np.zeros(2), self._start.states.copy())
        return belief

    def predict(self, step: Floats) -> None:
        """Move the robot by a motion `(3,)` (m, m, rad)."""
        self._pose = se2.compose(self._pose, step)

    def update(self, points: Floats) -> DrawingBelief:
        """The belief at a scan with points `(m, 2)` (robot's frame); the particles are weighed if the robot is at a new place."""
        visible, distances = self._visible(points)
        if len(visible) and distances[0] < NEW_PLACE_M * SPACING_M:
            self._here = int(visible[0])
        else:
            self._add_place(points, visible.tolist())
        some = np.arange(0, self._particles, max(self._particles // BELIEF_PARTICLES, 1))
        weights = self._weights()[some]
        belief = belief_of(self._robot_states(some), weights / weights.sum(), self._likelihood, points)
        return self._refined(belief, points)

    def shift(self, offset: Floats) -> None:
        """Move all particles by `(dx, dy)` in drawing units at the present place."""
        states = self._at(self._here).copy()
        states[:, :2] += offset
        self._drawn[self._here], self._ancestors[self._here] = states, np.arange(self._particles)

    def _visible(self, points: Floats) -> tuple[Ints, Floats]:
        """The places that the scan sees within the length of an edge, the nearest first, and their distances (m)."""
        offsets = self._centres - self._pose[:2]
        distances = np.hypot(*offsets.T)
        near = np.flatnonzero(distances < EDGE_M * SPACING_M)
        near = near[np.argsort(distances[near], kind="stable")]
        bearings = np.arctan2(offsets[near, 1], offsets[near, 0]) - self._pose[2]
        apart = np.abs(se2.wrap_angle(bearings[:, None] - np.arctan2(points[:, 1], points[:, 0])))
        before = np.hypot(*points.T) < distances[near][:, None] - MAX_UNKNOWN_M
        seen = near[~((apart < np.pi / BEAMS) & before).any(axis=1)]
        return seen, distances[seen]

    def _add_place(self, points: Floats, visible: list[int]) -> None:
        """A new place at the robot's pose, entered from the nearest one that is visible, weighed by what is visible from it."""
        if self._here not in visible:
            visible.append(self._here)
        centre, parent = self._pose[:2].copy(), visible[0]
        before = self._at(parent)
        here = predict_place(before, centre - self._centres[parent], CAREFUL.wide, self._rng)
        view = _view_of(points, self._pose[2])
        ranges = np.hypot(*view.T)
        open_view = open_points(ranges, view / np.maximum(ranges, 1e-6)[:, None])
        self._log_weights = self._log_weights + CAREFUL.view_weight * self._evidence.log_likelihood(
            view[::THINNED], open_view, here, self._sigma_m
        )
        self._log_weights -= CROSSED * self._evidence.crossed(before[:, :2], here[:, :2])
        deviations = (here[:, 3:] - self._first_scales) / SCALE_BOUND
        self._log_weights -= 0.5 * (deviations**2).sum(axis=1) * SCALE_BOUND_WEIGHT
        for other in visible[1:]:
            self._log_weights += loop_likelihood(here, self._at(other), centre - self._centres[other])
        self._here = len(self._centres)
        self._append(centre, here)
        weights = self._weights()
        if 1.0 / np.sum(weights**2) < RESAMPLE_BELOW * self._particles:
            tempered = weights**RESAMPLED_POWER
            chosen = systematic_resampling(tempered / tempered.sum(), self._particles, self._rng)
            self._ancestors = [ancestors[chosen] for ancestors in self._ancestors]
            self._log_weights = (1.0 - RESAMPLED_POWER) * self._log_weights[chosen]

    def _append(self, centre: Floats, states: Floats) -> None:
        self._centres = np.vstack([self._centres, centre])
        self._drawn.append(states)
        self._ancestors.append(np.arange(self._particles))

    def _robot_states(self, particles: Ints) -> Floats:
        """The robot's states `(k, 5)` of particles `(k,)`."""
        states = self._drawn[self._here][self._ancestors[self._here][particles]]
        states[:, :2] = to_drawing(states, self._pose[:2] - self._centres[self._here])
        states[:, 2] = se2.wrap_angle(states[:, 2] + self._pose[2])
        return states

    def _at(self, place: int) -> Floats:
        return self._drawn[place][self._ancestors[place]]

    def _weights(self) -> Floats:
        weights = np.exp(self._log_weights - self._log_weights.max())
        return np.asarray(weights / weights.sum())

    def _refined(self, belief: DrawingBelief, points: Floats) -> DrawingBelief:
        """The belief with its mean moved to where the scan's points lie best on drawn walls, within its standard deviations."""
        used = np.ascontiguousarray(points[evenly_spaced(len(points), REFINED_POINTS)])
        every = PlacePoints(used, np.array([0, len(used)]))
        scale = np.exp(0.5 * belief.state[3:].sum())
        information = 1.0 / np.maximum(belief.std, MIN_STD * [scale, scale, 1.0, 1.0, 1.0]) ** 2
        state = belief.state.copy()
        for _ in range(REFINEMENTS):
            equations = normal_equations(self._walls, self._evidence.cell, every, state[None], self._sigma_m)
            moved = state - belief.state
            moved[2] = se2.wrap_angle(moved[2])
            matrix = WALL_WEIGHT * equations.matrix[0] + np.diag(information)
            state = state - np.linalg.solve(matrix, WALL_WEIGHT * equations.gradient[0] + information * moved)
        state[2] = se2.wrap_angle(state[2])
        return DrawingBelief(state, belief.std, self._likelihood.inlier_ratio(points, state))


def _view_of(points: Floats, yaw: float) -> Floats:
    """One of the points `(m, 2)` (robot's frame) in each of `BEAMS` bearings, in their order and rotated by `yaw`."""
    near = points[np.hypot(*points.T) < VIEW_M]
    bearings = np.mod(np.arctan2(near[:, 1], near[:, 0]), 2.0 * np.pi)
    _, first = np.unique(np.floor(bearings * (BEAMS / (2.0 * np.pi))), return_index=True)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.asarray(near[first] @ np.array([[cos, sin], [-sin, cos]]))
