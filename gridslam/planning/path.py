"""Paths of lines, circular arcs and turns on the spot, with a speed profile (stereo-bayes, paper section 2.5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Kind = Literal["line", "arc", "turn"]


@dataclass(frozen=True, slots=True)
class Segment:
    """A line, an arc or a turn on the spot, in the map frame.

    It starts at (`x`, `y`, `yaw_rad`). `length_m` is negative where the robot drives backwards; `curvature` (1/m) is positive to
    the left; `angle_rad` is the change of heading. The segment takes `time_s`. Its speed (m/s, unsigned) rises from `enter_speed`
    to `top_speed` in the first `speed_up_s` and falls to `leave_speed` in the last `slow_down_s`; it is constant in between.
    """

    kind: Kind
    x: float
    y: float
    yaw_rad: float
    length_m: float = 0.0
    curvature: float = 0.0
    angle_rad: float = 0.0
    enter_speed: float = 0.0
    top_speed: float = 0.0
    leave_speed: float = 0.0
    speed_up_s: float = 0.0
    slow_down_s: float = 0.0
    time_s: float = 0.0

    @property
    def radius_m(self) -> float:
        """Radius of the arc: infinite for a line, 0 for a turn on the spot."""
        if self.kind == "turn":
            return 0.0
        return 1.0 / abs(self.curvature) if self.curvature else np.inf

    def poses(self, distances_m: Floats) -> Floats:
        """Poses `(n, 3)` at distances `(n,)` from the segment's start: m, or rad for a turn on the spot; not negative."""
        distances = np.asarray(distances_m, dtype=np.float64)
        if self.kind == "turn":
            yaw = self.yaw_rad + np.sign(self.angle_rad) * distances
            return np.column_stack([np.full_like(distances, self.x), np.full_like(distances, self.y), yaw])
        signed = np.copysign(1.0, self.length_m) * distances
        yaw = self.yaw_rad + signed * self.curvature
        if self.curvature == 0.0:
            x = self.x + signed * np.cos(self.yaw_rad)
            y = self.y + signed * np.sin(self.yaw_rad)
        else:
            x = self.x + (np.sin(yaw) - np.sin(self.yaw_rad)) / self.curvature
            y = self.y - (np.cos(yaw) - np.cos(self.yaw_rad)) / self.curvature
        return np.column_stack([x, y, yaw])

    @property
    def extent(self) -> float:
        """Length of the segment (m), or angle of a turn on the spot (rad); not negative."""
        return abs(self.angle_rad) if self.kind == "turn" else abs(self.length_m)

    @property
    def end_pose(self) -> Floats:
        """Pose `(3,)` at the end of the segment."""
        return np.asarray(self.poses(np.array([self.extent]))[0])


@dataclass(frozen=True, slots=True)
class ArcLinePath:
    """Consecutive segments with continuous heading, driven from rest to rest."""

    segments: tuple[Segment, ...]

    @property
    def length_m(self) -> float:
        """Distance driven, forwards and backwards (m)."""
        return float(sum(abs(s.length_m) for s in self.segments))

    @property
    def time_s(self) -> float:
        """Travel time (s)."""
        return float(sum(s.time_s for s in self.segments))

    def sampled(self, spacing_m: float) -> tuple[Floats, Floats, Floats]:
        """Times `(n,)` (s), poses `(n, 3)` and speeds `(n,)` (m/s, negative backwards) along the path.

        Consecutive poses are at most `spacing_m` apart (the same number in rad on a turn on the spot). Both ends of every
        segment are included; a pose shared by two segments appears once.
        """
        times, poses, speeds = [np.zeros(1)], [self.segments[0].poses(np.zeros(1))], [np.zeros(1)]
        start_s = 0.0
        for segment in self.segments:
            count = max(int(np.ceil(segment.extent / spacing_m)), 1)
            distances = segment.extent * np.arange(1, count + 1) / count
            elapsed_s, speed = _times_and_speeds(segment, distances)
            times.append(start_s + elapsed_s)
            poses.append(segment.poses(distances))
            speeds.append(np.copysign(speed, segment.length_m))
            start_s += segment.time_s
        return np.concatenate(times), np.concatenate(poses), np.concatenate(speeds)


def _times_and_speeds(segment: Segment, distances: Floats) -> tuple[Floats, Floats]:
    """Times since the segment's start (s) and unsigned speeds (m/s) at distances `(n,)` along it.

    Acceleration and deceleration are constant. A turn on the spot has a constant yaw rate and speed 0.
    """
    if segment.kind == "turn":
        return segment.time_s * distances / segment.extent, np.zeros_like(distances)
    v0, top, v1 = segment.enter_speed, segment.top_speed, segment.leave_speed
    up_s, down_s = segment.speed_up_s, segment.slow_down_s
    speed_up_m, slow_down_m = 0.5 * (v0 + top) * up_s, 0.5 * (top + v1) * down_s
    remaining = segment.extent - distances
    speed = np.full_like(distances, top)
    times = up_s + (distances - speed_up_m) / top
    is_speeding_up, is_slowing_down = distances < speed_up_m, remaining < slow_down_m
    if up_s > 0.0:
        acceleration = (top - v0) / up_s
        speed[is_speeding_up] = np.sqrt(
            np.maximum(v0**2 + 2.0 * acceleration * distances[is_speeding_up], 0.0)
        )
        times[is_speeding_up] = (speed[is_speeding_up] - v0) / acceleration
    if down_s > 0.0:
        deceleration = (top - v1) / down_s
        speed[is_slowing_down] = np.sqrt(
            np.maximum(v1**2 + 2.0 * deceleration * remaining[is_slowing_down], 0.0)
        )
        times[is_slowing_down] = segment.time_s - (speed[is_slowing_down] - v1) / deceleration
    return times, speed
