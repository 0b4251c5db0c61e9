"""Which drawn lines are observed, and what to do when one family of them is not (paper section 6.1, eqs. 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.raycast import cast_rays
from gridslam.maps.drawing import DrawnMap
from gridslam.matching.lines import Segments, difference_modulo_pi, hough_segments
from gridslam.methods.handmap_slam.config import LineConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.sensors.range_caster import range_caster

Floats = NDArray[np.float64]
Family = Literal["x", "y"]

ON_LINE_CELLS = 2.5  # an end point of the simulated scan so near to a drawn line lies on it
NOT_SEEN = -1
LEAST_COSINE = 0.5  # beams that graze a line do not tell whether it is there: the pose is not known so well


@dataclass(frozen=True, slots=True)
class ObservedLine:
    """A drawn line that should be visible.

    `family` x: the line lies across the x axis, and its distance is one along x. `drawn_m` is the distance to the drawn line
    and `observed_m` to the observed one, both in metres of the world; `probability` is their f. `side` is +1 when the line
    lies towards larger coordinates.
    """

    line: int
    family: Family
    side: int
    drawn_m: float
    observed_m: float
    probability: float


class LineObserver:
    """The drawing's lines, and what of them a scan confirms."""

    def __init__(self, drawn: DrawnMap, config: LineConfig) -> None:
        self._config = config
        self._geometry = drawn.geometry
        self._caster = range_caster(drawn.walls, drawn.geometry)
        self._bearings = (np.arange(config.beams) + 0.5) * (2.0 * np.pi / config.beams) - np.pi
        self._reach_m = float(np.hypot(*drawn.walls.shape)) * drawn.geometry.resolution_m
        self.lines = hough_segments(
            drawn.walls, drawn.geometry, config.drawn_length_m, config.drawn_gap_m, config.drawn_votes
        )

    def visible(self, pose: DrawingPose) -> tuple[NDArray[np.int64], Floats]:
        """A scan simulated in the drawing: its end points `(b, 2)`, and the drawn line `(b,)` that each lies on, or -1."""
        step = self._geometry.resolution_m
        at = np.array([[pose.x_m / step, pose.y_m / step, 0.0]])
        ranges = (
            np.asarray(cast_rays(self._caster.squares, at, self._bearings, self._reach_m / step))[0] * step
        )
        ends = np.column_stack([np.cos(self._bearings), np.sin(self._bearings)]) * ranges[:, None]
        ends += (pose.x_m, pose.y_m)
        if not len(self.lines):
            return np.full(len(ends), NOT_SEEN), ends
        distance = self.lines.distances_to(ends)
        nearest = distance.argmin(axis=1)
        on_line = distance.min(axis=1) < ON_LINE_CELLS * step
        on_line &= ranges < 0.999 * self._reach_m
        return np.where(on_line, nearest, NOT_SEEN), ends

    def observe(self, lines: Segments, beam_ends: Floats, pose: DrawingPose) -> list[ObservedLine]:
        """Every drawn line near a pose that can be judged, against the scan's `lines` and beams (robot's frame, metres).

        Near is what is drawn or observed within `near_m`. A drawn line with no counterpart is held against how far the beams go,
        `beam_ends` `(m, 2)`, where the simulated scan meets it: if they go beyond, the room goes on there. If they end before it
        or there are none, the line is hidden or out of the lidar's sight, and nothing can be said.
        """
        config = self._config
        at = np.array([pose.x_m, pose.y_m])
        seen, ends = self.visible(pose)
        drawn = Segments(pose.to_drawing(lines.starts), pose.to_drawing(lines.ends)) if len(lines) else lines
        long = lines.lengths_m >= config.least_length_m if len(lines) else np.zeros(0, np.bool_)
        reached = self._nearest_ends(beam_ends, pose)
        found = []
        for line in np.unique(seen[seen != NOT_SEEN]).tolist():
            on_line = seen == line
            if int(on_line.sum()) < config.least_beams:
                continue
            direction = float(self.lines.directions_rad[line])
            across_x = abs(np.cos(direction)) < abs(np.sin(direction))
            axis = 0 if across_x else 1
            scale = pose.scale_x if across_x else pose.scale_y
            expected = float((ends[on_line, axis] - at[axis]).mean()) / scale
            side = 1 if expected >= 0.0 else -1
            parallel = np.abs(difference_modulo_pi(drawn.directions_rad, direction)) < config.parallel_rad
            measured = _distances_along(drawn, at, axis) / scale
            candidates = measured[parallel & long & (np.sign(measured) == side)]
            if len(candidates):
                observed = float(candidates[np.abs(candidates - expected).argmin()])
            else:
                across = np.abs(ends[:, axis] - at[axis]) > LEAST_COSINE * np.hypot(*(ends - at).T)
                there = reached[on_line & across, axis] / scale
                there = there[np.isfinite(there)]
                if len(there) < config.least_beams:
                    continue
                observed = float(np.median(there))
                if side * observed < abs(expected):
                    continue
            if min(abs(expected), abs(observed)) > config.near_m:
                continue
            probability = float(np.exp(-((observed - expected) ** 2) / (2.0 * config.sigma_m**2)))
            found.append(
                ObservedLine(line, "x" if across_x else "y", side, abs(expected), abs(observed), probability)
            )
        return found

    def _nearest_ends(self, beam_ends: Floats, pose: DrawingPose) -> Floats:
        """Where the scan's beam along each simulated one ends `(b, 2)`, from the robot, drawing metres; NaN without."""
        found = np.full((len(self._bearings), 2), np.nan)
        if not len(beam_ends):
            return found
        away = pose.to_drawing(beam_ends) - (pose.x_m, pose.y_m)
        bearings = np.arctan2(away[:, 1], away[:, 0])
        beam = np.floor((bearings + np.pi) / (2.0 * np.pi) * len(found)).astype(np.int64) % len(found)
        order = np.argsort(-np.abs(bearings - self._bearings[beam]), kind="stable")
        found[beam[order]] = away[order]  # the nearest to the beam is written last
        return found


def families_observed(lines: list[ObservedLine], threshold: float) -> dict[Family, bool]:
    """For each family with drawn lines in view, whether any of them is observed."""
    observed: dict[Family, bool] = {}
    for line in lines:
        observed[line.family] = observed.get(line.family, False) or line.probability > threshold
    return observed


def correction_of(lines: list[ObservedLine], threshold: float, step_m: float) -> Floats:
    """The step `(2,)` of the position in the drawing (metres of the world) when one family is observed and the other is not.

    Towards the line when it is observed nearer than drawn (the drawing is longer than the room), else away from it; zero when
    both families are observed or neither is.
    """
    step = np.zeros(2)
    observed = families_observed(lines, threshold)
    if len(observed) < 2 or observed["x"] == observed["y"]:
        return step
    family: Family = "y" if observed["x"] else "x"
    nearest = max((line for line in lines if line.family == family), key=lambda line: line.probability)
    off = nearest.drawn_m - nearest.observed_m
    step[0 if family == "x" else 1] = nearest.side * float(np.clip(off, -step_m, step_m))
    return step


def _distances_along(lines: Segments, at: Floats, axis: int) -> Floats:
    """Signed distances `(k,)` along an axis to the middles of lines."""
    if not len(lines):
        return np.zeros(0)
    return np.asarray(0.5 * (lines.starts + lines.ends)[:, axis] - at[axis])
