"""Observed and missing drawn lines, and the correction if one family of them is missing (paper section 6.1, eqs. 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.grids.raycast import cast_rays
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.matching.lines import LineSegments, difference_modulo_pi, hough_segments
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.sensors.range_caster import range_caster

Floats = NDArray[np.float64]
Family = Literal["x", "y"]

# Lines of the drawing, found by the Hough transform; lengths in drawing units.
DRAWN_MIN_LENGTH = 1.0
DRAWN_MAX_GAP = 0.5
DRAWN_MIN_VOTES = 8

SIMULATED_BEAMS = 180
MIN_BEAMS = 4  # number of beams of the simulated scan on a drawn line from which it counts as visible
ON_LINE_CELLS = 2.5  # a simulated endpoint this close to a drawn line lies on it
NO_LINE = -1
NO_RETURN = 0.999  # fraction of the maximum range: longer simulated beams hit nothing

MIN_LENGTH_M = 0.8  # smallest length of a line of the scan
PARALLEL_RAD = 0.26  # lines whose directions differ by less may correspond
MAX_DISTANCE_M = 8.0  # largest distance from the robot to a line, as drawn or as observed
# Of a beam to a line's normal: with an uncertain pose, grazing beams show nothing about the line
MIN_COSINE = 0.5
SIGMA_M = 0.5  # sigma of eq. 1, in metres of the world
OBSERVED_PROBABILITY = 0.3  # f above this: the line is observed


@dataclass(frozen=True, slots=True)
class ObservedLine:
    """A drawn line that should be visible.

    `family` x: the line runs across the x axis, and its distance is measured along x. `drawn_m` is the distance to the drawn line
    and `observed_m` to the observed one, both in metres of the world; `probability` is f of eq. 1. `side` is +1 if the line lies
    towards larger coordinates.
    """

    line: int
    family: Family
    side: int
    drawn_m: float
    observed_m: float
    probability: float


class _ScanInDrawing(NamedTuple):
    """A scan seen from a pose, in the drawing frame: position `(2,)`, lines, and which of them are long enough.

    `endpoints` `(b, 2)` are those of the scan's beam along each simulated beam, relative to the robot; NaN without one.
    """

    position: Floats
    lines: LineSegments
    is_long: NDArray[np.bool_]
    endpoints: Floats


class LineObserver:
    """The drawing's lines, and which of them a scan confirms."""

    def __init__(self, drawn: DrawnMap) -> None:
        self._geometry = drawn.geometry
        self._caster = range_caster(drawn.walls, drawn.geometry)
        self._bearings = (np.arange(SIMULATED_BEAMS, dtype=np.float64) + 0.5) * (
            2.0 * np.pi / SIMULATED_BEAMS
        ) - np.pi
        self._max_range = float(np.hypot(*drawn.walls.shape)) * drawn.geometry.resolution_m
        self.lines = hough_segments(
            drawn.walls, drawn.geometry, DRAWN_MIN_LENGTH, DRAWN_MAX_GAP, DRAWN_MIN_VOTES
        )

    def visible(self, pose: DrawingPose) -> tuple[NDArray[np.int64], Floats]:
        """The drawn line `(b,)` that each beam of a simulated scan hits (NO_LINE: none), and the endpoints `(b, 2)`."""
        step = self._geometry.resolution_m
        origin = np.array([[pose.x / step, pose.y / step, 0.0]])
        cast = cast_rays(self._caster.boxes, origin, self._bearings, self._max_range / step)
        ranges = np.asarray(cast)[0] * step
        endpoints = np.column_stack([np.cos(self._bearings), np.sin(self._bearings)]) * ranges[:, None]
        endpoints += (pose.x, pose.y)
        if not len(self.lines):
            return np.full(len(endpoints), NO_LINE), endpoints
        distance = self.lines.distances_to(endpoints)
        nearest = distance.argmin(axis=1)
        on_line = distance.min(axis=1) < ON_LINE_CELLS * step
        on_line &= ranges < NO_RETURN * self._max_range
        return np.where(on_line, nearest, NO_LINE), endpoints

    def observe(self, lines: LineSegments, endpoints: Floats, pose: DrawingPose) -> list[ObservedLine]:
        """The drawn lines near a pose that the scan confirms or contradicts.

        `lines` are the scan's lines and `endpoints` `(m, 2)` those of its beams (robot's frame, m). A drawn line without a
        counterpart is compared with the beams where the simulated scan hits it: if they go farther, the room continues there. If
        they end before it or there are none, the line is hidden or out of range, and nothing is concluded.
        """
        visible, simulated = self.visible(pose)
        in_drawing = (
            LineSegments(pose.to_drawing(lines.starts), pose.to_drawing(lines.ends)) if len(lines) else lines
        )
        is_long = lines.lengths_m >= MIN_LENGTH_M if len(lines) else np.zeros(0, np.bool_)
        position = np.array([pose.x, pose.y])
        scan = _ScanInDrawing(position, in_drawing, is_long, self._endpoints_along_beams(endpoints, pose))
        found = []
        for line in np.unique(visible[visible != NO_LINE]).tolist():
            on_line = visible == line
            if int(on_line.sum()) >= MIN_BEAMS:
                observed = self._observe_line(line, on_line, simulated, scan, pose)
                if observed is not None:
                    found.append(observed)
        return found

    def _observe_line(
        self,
        line: int,
        on_line: NDArray[np.bool_],
        simulated: Floats,
        scan: _ScanInDrawing,
        pose: DrawingPose,
    ) -> ObservedLine | None:
        """One drawn line, hit by the simulated beams `on_line`; None if nothing is concluded or it is far away."""
        direction = float(self.lines.directions_rad[line])
        across_x = abs(np.cos(direction)) < abs(np.sin(direction))
        axis = 0 if across_x else 1
        scale = pose.scale_x if across_x else pose.scale_y
        offsets = simulated - scan.position
        expected = float((simulated[on_line, axis] - scan.position[axis]).mean()) / scale
        side = 1 if expected >= 0.0 else -1
        is_parallel = np.abs(difference_modulo_pi(scan.lines.directions_rad, direction)) < PARALLEL_RAD
        measured = _distances_along(scan.lines, scan.position, axis) / scale
        candidates = measured[is_parallel & scan.is_long & (np.sign(measured) == side)]
        if len(candidates):
            observed = float(candidates[np.abs(candidates - expected).argmin()])
        else:
            is_steep = np.abs(simulated[:, axis] - scan.position[axis]) > MIN_COSINE * np.hypot(*offsets.T)
            distances = scan.endpoints[on_line & is_steep, axis] / scale
            distances = distances[np.isfinite(distances)]
            if len(distances) < MIN_BEAMS:
                return None
            observed = float(np.median(distances))
            if side * observed < abs(expected):
                return None
        if min(abs(expected), abs(observed)) > MAX_DISTANCE_M:
            return None
        probability = float(np.exp(-((observed - expected) ** 2) / (2.0 * SIGMA_M**2)))
        family: Family = "x" if across_x else "y"
        return ObservedLine(line, family, side, abs(expected), abs(observed), probability=probability)

    def _endpoints_along_beams(self, endpoints: Floats, pose: DrawingPose) -> Floats:
        """The endpoint `(b, 2)` of the scan's beam along each simulated beam, relative to the robot (drawing units); or NaN."""
        found = np.full((len(self._bearings), 2), np.nan)
        if not len(endpoints):
            return found
        offsets = pose.to_drawing(endpoints) - (pose.x, pose.y)
        bearings = np.arctan2(offsets[:, 1], offsets[:, 0])
        beam = np.floor((bearings + np.pi) / (2.0 * np.pi) * len(found)).astype(np.int64) % len(found)
        order = np.argsort(-np.abs(bearings - self._bearings[beam]), kind="stable")
        found[beam[order]] = offsets[order]  # the one nearest to the beam is written last
        return found


def families_observed(lines: list[ObservedLine]) -> dict[Family, bool]:
    """For each family with drawn lines in view, whether any of them is observed."""
    observed: dict[Family, bool] = {}
    for line in lines:
        is_observed = line.probability > OBSERVED_PROBABILITY
        observed[line.family] = observed.get(line.family, False) or is_observed
    return observed


def correction_of(lines: list[ObservedLine], step_m: float) -> Floats:
    """The step `(2,)` of the position in the drawing (metres of the world) if exactly one family is observed, else zero.

    The step has length `step_m` at most. It leads towards the unobserved line if that is observed closer than drawn (the
    drawing is longer than the room), otherwise away from it.
    """
    step = np.zeros(2)
    observed = families_observed(lines)
    if len(observed) < 2 or observed["x"] == observed["y"]:
        return step
    family: Family = "y" if observed["x"] else "x"
    nearest = max((line for line in lines if line.family == family), key=lambda line: line.probability)
    difference = nearest.drawn_m - nearest.observed_m
    step[0 if family == "x" else 1] = nearest.side * float(np.clip(difference, -step_m, step_m))
    return step


def _distances_along(lines: LineSegments, position: Floats, axis: int) -> Floats:
    """Signed distances `(k,)` along an axis to the midpoints of lines."""
    if not len(lines):
        return np.zeros(0)
    return np.asarray(0.5 * (lines.starts + lines.ends)[:, axis] - position[axis])
