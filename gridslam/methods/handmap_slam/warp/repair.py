"""Regions of the map whose places fit badly are searched again, with the rest held where it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence
from gridslam.methods.handmap_slam.warp.places import PlaceGraph, distances_along
from gridslam.methods.handmap_slam.warp.refinement import Fitted, Refinement
from gridslam.methods.handmap_slam.warp.search import Known, distinct, find_places

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
# Of all places, and the one from which each is entered
PlaceOrder = tuple[NDArray[np.int64], NDArray[np.int64]]

ROUNDS = 12
MAX_ROUNDS = 24  # largest number of rounds while the drawing does not fit
MAX_COST_PER_PLACE = 4.45  # cost that most drawings of the right place stay below
HOPELESS_COST, HOPELESS_QUIET = 6.5, 4  # above this cost the search ends after fewer quiet rounds
QUIET = 6  # rounds without a fit that is better by `WORTH`, after which the search ends
WORTH = 3.0
# Regions, in turn: all about a place that cost at least this fraction of it and hang together, or all within this distance (m),
# searched from where the robot entered them, or from where it left them.
REGIONS = (
    ("cost", 0.75, "entry"),
    ("cost", 0.6, "exits"),
    ("distance", 15.0, "entry"),
    ("distance", 30.0, "exits"),
    ("cost", 0.6, "entry"),
    ("cost", 0.4, "exits"),
    ("distance", 30.0, "entry"),
)
FOLD_PRIORITY = (
    4.0  # added to the cost of places in a fold when regions are chosen: as much as a bad fit costs
)
GROWN_M = 6.0  # distance by which a region reaches beyond the costly places
MAX_RADIUS_M = 45.0
SMOOTHING_M = 6.0
FAR_M = 1e9  # distance of a place that no path joins to an exit
TRIED = 0.75  # factor of a place's priority after each round in which it was searched
PARTICLES = 1500
HYPOTHESES = 3
# What lies one room too far along a corridor is displaced as a whole. Regions are also moved by this much along and across their
# longer extent, less towards their ends.
SLIDE_M, RIGHT_ANGLES = 2.0, 0.5 * np.pi * np.arange(4)
SLIDE_COST = 3.8  # mean cost of the places about one from which they are moved as a whole
SLIDE_RADIUS_M, SLIDE_SPACING_M, MAX_SLIDES = 20.0, 8.0, 16
DIFFERS_M = 1.0  # a place lies elsewhere in two fits that are this far apart
MARGIN_M = 3.0  # distance from places that lie elsewhere in which costs may differ too
# A place is doubtful if the mean cost of the places about it is above a limit: that of a good fit, plus a factor times the
# additional cost of the place's best alternative, up to the last limit. It is doubtful too if the alternative is about as good.
DOUBT_STD_M = 15.0
GOOD_COST, PER_ALTERNATIVE, MAX_COST = 3.2, 1.2, 5.5
AS_GOOD = 0.3
# Below this information on the position (1 / m^2) no wall shows how far along a place lies. If a stretch is more than twice this
# length, and a log scale changes over it by this much, nothing shows where it changes.
MIN_INFORMATION, PLAIN_M, SCALE_CHANGE = 2.0, 6.0, 0.15


class Repair:
    """The best fit that was met, and which of its places `(p,)` are doubtful."""

    def __init__(
        self,
        graph: PlaceGraph,
        evidence: DrawnEvidence,
        problem: Refinement,
        fits: list[Fitted],
        rng: np.random.Generator,
    ) -> None:
        self._graph, self._evidence, self._problem, self._rng = graph, evidence, problem, rng
        self._distances = distances_along(graph)
        self._near = smoothing(self._distances, SMOOTHING_M)
        self._met = list(fits)
        self.best = min(fits, key=lambda fit: fit.cost)
        self._take_better_parts()
        self._search()
        self._take_better_parts()
        self._slide()
        self._take_better_parts()

    def _search(self) -> None:
        """Search the regions about the costliest places again, those less that were searched before."""
        priority = np.ones(len(self.best.states))
        quiet = 0
        for count in range(MAX_ROUNDS):
            cost = self.best.cost_per_place
            if (count >= ROUNDS or quiet >= QUIET) and cost < MAX_COST_PER_PLACE:
                break
            if quiet >= HOPELESS_QUIET and cost > HOPELESS_COST:
                break
            folds = FOLD_PRIORITY * self._problem.folded(self.best.states)
            costs = self._near @ (self.best.place_costs + folds)
            kind, extent, searched_from = REGIONS[count % len(REGIONS)]
            region = self._region(int(np.argmax(costs * priority)), costs, kind, extent)
            priority[region] *= TRIED
            fits = self._search_again(
                region, from_exits(self._graph, region, costs) if searched_from == "exits" else None
            )
            self._met += fits
            found = min(fits, key=lambda fit: fit.cost)
            before = self.best.cost
            if found.cost < before:
                self._take(self._problem.fit(found.states))
            quiet = quiet + 1 if self.best.cost > before - WORTH else 0

    def _slide(self) -> None:
        """Move the regions about costly places as a whole: what is then better is taken, what is about as good is a doubt."""
        todo = self._nearby_costs() > SLIDE_COST
        if self.best.cost_per_place > MAX_COST:
            return  # nothing fits, and moving parts of it does not help
        for _ in range(MAX_SLIDES):
            if not todo.any():
                break
            centre = int(np.argmax(np.where(todo, self._near @ self.best.place_costs, 0.0)))
            region = self._distances[centre] < SLIDE_RADIUS_M
            todo &= self._distances[centre] > SLIDE_SPACING_M
            fits = [self._problem.fit(s, region) for s in slid(self.best.states, region, self._distances)]
            self._met += fits
            found = min(fits, key=lambda fit: fit.cost)
            if found.cost < self.best.cost - WORTH:
                self._take(self._problem.fit(found.states))

    def _region(self, centre: int, costs: Floats, kind: str, extent: float) -> Mask:
        if kind == "distance":
            return np.asarray(self._distances[centre] < extent)
        a, b = self._graph.edges[(costs[self._graph.edges] > extent * costs[centre]).all(axis=1)].T
        p = len(costs)
        _, parts = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(p, p)), directed=False)
        grown = (self._distances[parts == parts[centre]] < GROWN_M).any(axis=0)
        return np.asarray(grown & (self._distances[centre] < MAX_RADIUS_M))

    def _take(self, fit: Fitted) -> None:
        """Keep the better of a fit and the best one as the best, and the other one as an alternative."""
        better, other = (fit, self.best) if fit.cost < self.best.cost else (self.best, fit)
        self._met.append(other)
        self.best = better

    def _take_better_parts(self) -> None:
        """Parts of other fits that are better than the best one's, which was found after them, are taken over."""
        for met in list(self._met):
            elsewhere, around = self._elsewhere(met.states)
            more = (met.place_costs - self.best.place_costs)[around].sum()
            if not elsewhere.any() or more > self.best.contradictions:
                continue  # all contradictions that it might solve are worth less
            merged = self._problem.fitted(np.where(around[:, None], met.states, self.best.states))
            if more + merged.contradictions < self.best.contradictions:
                self._take(self._problem.fit(merged.states, around))

    def _search_again(self, region: Mask, backwards: PlaceOrder | None) -> list[Fitted]:
        """Other fits, in which the places of a region are placed anew."""
        states, graph = self.best.states, self._graph
        first = np.repeat(states[:1], PARTICLES, axis=0)
        if backwards is None:
            lines = find_places(graph, self._evidence, first, self._rng, Known(~region, states))
        else:
            order, parents = backwards
            known = Known(~region[order], states[order])
            ordered = graph.in_order(order, parents)
            lines = find_places(ordered, self._evidence, first, self._rng, known)
            lines = lines[:, np.argsort(order)]
        return [self._problem.fit(line, region) for line in distinct(lines, region, HYPOTHESES)]

    def _elsewhere(self, states: Floats) -> tuple[Mask, Mask]:
        """Mask `(p,)` of the places that lie elsewhere than in the best fit, and that of these with all places around them."""
        best = self.best.states
        scales = np.exp(best[:, 3:].mean(axis=1))
        elsewhere = np.hypot(*(states - best)[:, :2].T) > DIFFERS_M * scales
        around = elsewhere | (self._distances[elsewhere] < MARGIN_M).any(axis=0)
        return elsewhere, around

    def alternatives(self) -> Floats:
        """The additional cost `(p,)` of each place's best alternative, mean over the places that lie elsewhere with it.

        Infinite where none was met.
        """
        smallest = np.full(len(self.best.states), np.inf)
        for met in self._met:
            elsewhere, around = self._elsewhere(met.states)
            if elsewhere.any():
                more = (met.place_costs - self.best.place_costs)[around].sum()
                more += met.contradictions - self.best.contradictions
                smallest[elsewhere] = np.minimum(smallest[elsewhere], more / elsewhere.sum())
        return smallest

    def _nearby_costs(self) -> Floats:
        """Mean costs `(p,)` of the places about each."""
        return np.asarray(smoothing(self._distances, DOUBT_STD_M) @ self.best.place_costs)

    @property
    def doubtful(self) -> Mask:
        """The places `(p,)` that do not fit, or would fit about as well elsewhere."""
        more, states = self.alternatives(), self.best.states
        limit = np.minimum(GOOD_COST + PER_ALTERNATIVE * more, MAX_COST)
        fixed = self._problem.min_information(states) > MIN_INFORMATION
        plain = unlocated_stretches(fixed, states[:, 3:], self._distances)
        folded = self._problem.folded(states)
        folded |= (self._distances[folded] < GROWN_M).any(axis=0)
        return np.asarray((self._nearby_costs() > limit) | (more < AS_GOOD) | plain | folded)


def slid(states: Floats, region: Mask, distances: Floats) -> list[Floats]:
    """States `(p, 5)` with the places of a region `(p,)` displaced in the drawing, in each of four directions."""
    inside = np.min(distances[:, ~region], axis=1, initial=FAR_M)
    length = SLIDE_M * np.clip(inside / (2.0 * SLIDE_M), 0.0, 1.0) * np.exp(0.5 * states[:, 3:].sum(axis=1))
    at = states[region, :2]
    along = np.linalg.svd(at - at.mean(axis=0), full_matrices=False)[2][0]
    bearings = np.arctan2(along[1], along[0]) + RIGHT_ANGLES
    still = np.zeros((len(states), 3))
    return [states + np.column_stack([length * np.cos(b), length * np.sin(b), still]) for b in bearings]


def unlocated_stretches(fixed: Mask, log_scales: Floats, distances: Floats) -> Mask:
    """The places `(p,)` of long stretches over which scales `(p, 2)` change and no wall shows how far along they lie."""
    found = np.zeros(len(fixed), np.bool_)
    away = np.min(distances[:, fixed], axis=1, initial=FAR_M)
    for middle in np.flatnonzero(away > PLAIN_M):
        stretch = distances[middle] < PLAIN_M + MARGIN_M
        found |= stretch & (np.ptp(log_scales[stretch], axis=0).max() > SCALE_CHANGE)
    return found


def from_exits(graph: PlaceGraph, region: Mask, costs: Floats) -> PlaceOrder | None:
    """The order in which a region `(p,)` is searched from where the robot left it; None if no place there fits better.

    Places that are held come first. Each place of the region is entered from one before it on the shortest path to an exit.
    """
    a, b = np.concatenate([graph.edges, graph.edges[:, ::-1]]).T
    exits = np.unique(b[region[a] & ~region[b]])
    exits = exits[(exits > np.flatnonzero(region)[0]) & (costs[exits] < costs[region].mean())]
    if not len(exits):
        return None
    within = region[a] & (region[b] | np.isin(b, exits))
    lengths = np.maximum(np.hypot(*(graph.centres[a] - graph.centres[b])[within].T), 1e-3)
    p = len(region)
    paths = coo_matrix((lengths, (b[within], a[within])), shape=(p, p)).tocsr()
    away, before, _ = dijkstra(paths, indices=exits, min_only=True, return_predecessors=True)
    order = np.argsort(np.where(region, np.minimum(away, FAR_M), -1.0), kind="stable")
    return order, np.where(region, np.where(before >= 0, before, exits[0]), -1).astype(np.int64)


def smoothing(distances: Floats, std_m: float) -> Floats:
    """Weights `(p, p)` of the mean over the places around each."""
    near = np.exp(-0.5 * (distances / std_m) ** 2)
    return np.asarray(near / near.sum(axis=1, keepdims=True))
