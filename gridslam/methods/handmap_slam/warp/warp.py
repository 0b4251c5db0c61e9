"""The warp: from the finished map and the trajectory to the drawing, all at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.resampling import systematic_resampling
from gridslam.kernels.threads import on_threads
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import PlaceGraph, place_graph
from gridslam.methods.handmap_slam.warp.refinement import Fitted, Refinement
from gridslam.methods.handmap_slam.warp.repair import Repair
from gridslam.methods.handmap_slam.warp.search import (
    CAREFUL,
    PARTICLES,
    SIGMA_M,
    WIDE,
    distinct,
    find_places,
)

Floats = NDArray[np.float64]

# The searches in turn, each with the cost of a place above which it is made: one alone misses one drawing in twenty
SEARCHES = ((CAREFUL, 0.0), (WIDE, 3.4), (CAREFUL, 4.2), (WIDE, 4.2))
HYPOTHESES = 4  # refined, of each search
ANNEALING = (0.05, 0.1, 0.2, 0.35)
START_PARTICLES = 12000
START_JITTER = 0.3
# A drawing of the place is about as large as the map, or larger: std of its log scale above that. One view alone is matched best
# at a scale that is too large, where there are walls everywhere.
EXTENT_STD = 0.15
# A drawing of another place is laid over a map as well where it may be deformed enough, and leads the robot through walls: its
# contradictions cost 0.86 to 2.4 a place, those of right drawings 0.6 at most (drawings 0 to 24, 100 to 149, 200 to 239). Their
# costs overlap, the misfits do not: 6.4 at most, 7.7 at least.
DEFORMATION_WEIGHT, CONTRADICTION_WEIGHT, MAX_MISFIT = 2.0, 3.0, 7.0
BLEND_M = 0.7  # places are blended with weights that fall off at this distance


@dataclass(frozen=True)
class DrawingWarp:
    """Places of the map with their states `(p, 5)` in the drawing: x, y, yaw of the map frame, log scales along its axes.

    `doubtful` `(p,)` are places that do not fit there, or would fit about as well elsewhere.
    """

    graph: PlaceGraph
    states: Floats
    cost_per_place: float
    deformation_per_place: float  # the part of the cost that is for changes from a place to its neighbours
    contradictions_per_place: float  # cost of walls passed, drawn walls not mapped, and folds
    doubtful: NDArray[np.bool_]

    @property
    def misfit(self) -> float:
        """The cost of a place, with what the drawing had to be deformed for it counted more than once, and its contradictions."""
        return (
            self.cost_per_place
            + DEFORMATION_WEIGHT * self.deformation_per_place
            + CONTRADICTION_WEIGHT * self.contradictions_per_place
        )

    @property
    def fits(self) -> bool:
        """Whether the drawing shows the place of the map, and the robot was found in it."""
        return self.misfit < MAX_MISFIT

    @property
    def doubtful_poses(self) -> NDArray[np.bool_]:
        """Mask `(n,)` of the poses of the drive at places that may lie elsewhere in the drawing: all, if it does not fit."""
        return np.asarray(self.doubtful[self.graph.owners] | (not self.fits))

    def to_drawing(self, points: Floats, owners: NDArray[np.int64]) -> Floats:
        """Points `(n, 2)` of the map (m) in the drawing, blended from the places that own them and these places' neighbours."""
        total = np.zeros((len(points), 2))
        weights = np.zeros((len(points), 1))
        for near in self._neighbours[owners].T:
            offsets = points - self.graph.centres[near]
            weight = np.exp(-0.5 * (offsets**2).sum(axis=1) / BLEND_M**2)[:, None] + 1e-9
            total += weight * to_drawing(self.states[near], offsets)
            weights += weight
        return np.asarray(total / weights)

    @cached_property
    def _neighbours(self) -> NDArray[np.int64]:
        """Each place with up to four of its neighbours `(p, 5)`, itself where it has fewer."""
        p = len(self.states)
        lists: list[list[int]] = [[k] for k in range(p)]
        lengths = np.hypot(
            *(self.graph.centres[self.graph.edges[:, 0]] - self.graph.centres[self.graph.edges[:, 1]]).T
        )
        for a, b in self.graph.edges[np.argsort(lengths, kind="stable")].tolist():
            lists[a].append(b)
            lists[b].append(a)
        return np.array([(each + 5 * each[:1])[:5] if len(each) < 5 else each[:5] for each in lists])


@on_threads(1)  # the kernels' tasks are so small that handing them out costs more CPU than it saves time
def warp_of(
    drawn: DrawnMap,
    occupancy: OccupancyGrid,
    poses: Floats,
    first: Callable[[Floats], Floats],
    rng: np.random.Generator,
) -> DrawingWarp:
    """Find the warp of a map with a drive along poses `(n, 3)`.

    `first` gives hypotheses `(n, 5)` for the first pose (x, y, yaw of the robot, log scales) from the points `(m, 2)` visible
    there (robot's frame, m).
    """
    graph = place_graph(occupancy, poses)
    evidence = DrawnEvidence(drawn)
    to_robot = np.array([0.0, 0.0, -poses[0, 2]])
    states = first(se2.transform_points(to_robot, graph.views[0])).copy()
    states[:, 2] -= poses[0, 2]
    excess = np.maximum(states[:, 3:].mean(axis=1) - _max_log_scale(drawn, graph), 0.0)
    log_prior = -0.5 * (excess / EXTENT_STD) ** 2
    problem = Refinement(graph, evidence)
    fits: list[Fitted] = []
    everywhere = np.ones(len(graph.centres), np.bool_)
    for scope, above_cost in SEARCHES:
        if fits and min(fits, key=lambda fit: fit.cost).cost_per_place <= above_cost:
            break
        start = _annealed(states, log_prior, graph, evidence, rng)
        lines = find_places(graph, evidence, start, rng, scope=scope)
        fits += [problem.fit(line) for line in distinct(lines, everywhere, HYPOTHESES)]
    repair = Repair(graph, evidence, problem, fits, rng)
    best = repair.best
    deformation = float(problem.deformation_costs(best.states).mean())
    return DrawingWarp(
        graph,
        best.states,
        cost_per_place=best.cost_per_place,
        deformation_per_place=deformation,
        contradictions_per_place=best.contradictions / len(best.states),
        doubtful=repair.doubtful,
    )


def _max_log_scale(drawn: DrawnMap, graph: PlaceGraph) -> float:
    """The log scale at which the map is as large as the drawing."""
    seen = np.concatenate([view + centre for view, centre in zip(graph.views, graph.centres, strict=True)])
    drawn_m = _diameter(np.argwhere(drawn.walls)) * drawn.geometry.resolution_m
    return float(np.log(drawn_m / max(_diameter(np.concatenate([seen, graph.centres])), 1.0)))


def _diameter(points: Floats | NDArray[np.int64]) -> float:
    """The largest distance between any two of the points `(n, 2)`."""
    hull = cv2.convexHull(points.astype(np.float32))[:, 0].astype(np.float64)
    return float(np.hypot(*(hull[:, None] - hull[None]).T).max())


def _annealed(
    states: Floats, log_prior: Floats, graph: PlaceGraph, evidence: DrawnEvidence, rng: np.random.Generator
) -> Floats:
    """Particles of the first place."""
    previous = 0.0
    for k, power in enumerate(ANNEALING):
        score = (power - previous) * evidence.log_likelihood(
            graph.views[0], graph.open_views[0], states, SIGMA_M
        )
        if k == 0:
            score += log_prior
        previous = power
        weights = np.exp(score - score.max())
        count = PARTICLES if k == len(ANNEALING) - 1 else START_PARTICLES
        states = states[systematic_resampling(weights / weights.sum(), count, rng)]
        std = np.minimum(states.std(axis=0), (0.5, 0.5, 0.15, 0.2, 0.2)) * START_JITTER
        states = states + rng.standard_normal(states.shape) * std
    states[:, 2] = se2.wrap_angle(states[:, 2])
    return states
