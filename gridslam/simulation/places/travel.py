"""A robot's travel through a place: from node to node along the lanes, over and over, and back to where it began."""

from __future__ import annotations

import heapq
import itertools
import math
from collections import Counter

import numpy as np

from gridslam.simulation.places.layout import XY, Lane, Layout

STRAIGHT_RAD = 0.03  # a node is driven through without stopping where the lane goes on within this
SHORTEST_M = 2.0  # there is no turning back for less
SPACING_M = (8.0, 20.0)  # smallest and largest distance of waypoints between nodes


def travel(layout: Layout, travel_m: float, rng: np.random.Generator) -> tuple[list[XY], float]:
    """Way points from the first to the last, and the length (m) of the polyline through them: `travel_m` within 3 %."""
    nodes = _visits(layout, travel_m, rng)
    points = _waypoints(layout, nodes, rng)
    return points, float(sum(math.dist(a, b) for a, b in itertools.pairwise(points)))


def _visits(layout: Layout, travel_m: float, rng: np.random.Generator) -> list[int]:
    """Nodes in order: lanes driven least come first, straight on where there is a choice; then the shortest path back."""
    lanes = _lanes_of(layout)
    start = int(rng.choice([node for node, found in lanes.items() if len(found) > 1]))
    back_m, back_to = _shortest_paths(layout, lanes, start)
    visits, driven, length = [start], Counter[int](), 0.0
    while True:
        here = visits[-1]
        before = visits[-2] if len(visits) > 1 else None
        choices = [k for k in lanes[here] if _other(layout.lanes[k], here) != before] or lanes[here]
        costs = [
            driven[k] + 0.8 * rng.random() - 0.3 * _is_straight(layout, before, here, k) for k in choices
        ]
        lane = choices[int(np.argmin(costs))]
        there = _other(layout.lanes[lane], here)
        length += _length(layout, layout.lanes[lane])
        if length + back_m[there] > travel_m:
            spare_m = travel_m - (length - _length(layout, layout.lanes[lane])) - back_m[here]
            visits += _there_and_back(layout, here, lane, 0.5 * spare_m)
            break
        driven[lane] += 1
        visits.append(there)
    while visits[-1] != start:
        visits.append(back_to[visits[-1]])
    return visits


def _there_and_back(layout: Layout, here: int, lane: int, distance_m: float) -> list[int]:
    """A new node in the middle of a lane, where the robot turns, and the node that it came from."""
    if distance_m < SHORTEST_M:
        return []
    start, end = layout.nodes[here], layout.nodes[_other(layout.lanes[lane], here)]
    part = min(distance_m / math.dist(start, end), 1.0)
    far_node = layout.add_node((start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])))
    layout.add_lanes((here, far_node), layout.lanes[lane].lateral_m)
    return [far_node, here]


def _waypoints(layout: Layout, visits: list[int], rng: np.random.Generator) -> list[XY]:
    """The nodes where the robot turns, and points beside the centre line between them: it never drives the same line twice."""
    lateral = {frozenset((lane.first, lane.second)): lane.lateral_m for lane in layout.lanes}
    points = [layout.nodes[visits[0]]]
    for k in range(1, len(visits)):
        start, end = np.array(layout.nodes[visits[k - 1]]), np.array(layout.nodes[visits[k]])
        length = float(np.hypot(*(end - start)))
        span = (end - start) / length
        limit = lateral[frozenset(visits[k - 1 : k + 1])]
        along = float(rng.uniform(*SPACING_M))
        while limit > 0.0 and along < length - 4.0:
            offset = float(rng.uniform(-limit, limit))
            x, y = (start + along * span + offset * np.array([-span[1], span[0]])).tolist()
            points.append((x, y))
            along += float(rng.uniform(*SPACING_M))
        if k + 1 == len(visits) or not _goes_on(layout, visits[k - 1], visits[k], visits[k + 1]):
            points.append(layout.nodes[visits[k]])
    return points


def _lanes_of(layout: Layout) -> dict[int, list[int]]:
    """The lanes at each node."""
    found: dict[int, list[int]] = {node: [] for node in range(len(layout.nodes))}
    for k, lane in enumerate(layout.lanes):
        found[lane.first].append(k)
        found[lane.second].append(k)
    return {node: lanes for node, lanes in found.items() if lanes}


def _shortest_paths(
    layout: Layout, lanes: dict[int, list[int]], start: int
) -> tuple[dict[int, float], dict[int, int]]:
    """Distance (m) of every node from `start`, and its next node on the way there (Dijkstra)."""
    distance, towards = {start: 0.0}, {start: start}
    waiting = [(0.0, start)]
    while waiting:
        length, node = heapq.heappop(waiting)
        if length > distance[node]:
            continue
        for k in lanes[node]:
            other = _other(layout.lanes[k], node)
            longer = length + _length(layout, layout.lanes[k])
            if longer < distance.get(other, math.inf):
                distance[other], towards[other] = longer, node
                heapq.heappush(waiting, (longer, other))
    return distance, towards


def _other(lane: Lane, node: int) -> int:
    return lane.second if lane.first == node else lane.first


def _length(layout: Layout, lane: Lane) -> float:
    return math.dist(layout.nodes[lane.first], layout.nodes[lane.second])


def _is_straight(layout: Layout, before: int | None, here: int, lane: int) -> bool:
    return before is not None and _yaw_change(layout, before, here, _other(layout.lanes[lane], here)) < 0.3


def _goes_on(layout: Layout, before: int, here: int, after: int) -> bool:
    return _yaw_change(layout, before, here, after) < STRAIGHT_RAD


def _yaw_change(layout: Layout, before: int, here: int, after: int) -> float:
    a, b, c = (layout.nodes[node] for node in (before, here, after))
    arriving, leaving = math.atan2(b[1] - a[1], b[0] - a[0]), math.atan2(c[1] - b[1], c[0] - b[0])
    return abs(math.remainder(leaving - arriving, math.tau))
