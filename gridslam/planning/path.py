"""A path of straight lines and circular arcs, with the speeds on it (stereo-bayes, paper section 2.5)."""

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

    It begins at (`x`, `y`, `yaw_rad`). `length_m` is negative where the robot drives backwards; `curvature` (1/m) is
    positive to the left; `angle_rad` is the change of heading. The speed (m/s, not signed) rises from `enter_speed` to
    `top_speed` within `rise_s`, holds, and falls to `leave_speed` in the last `fall_s` of `time_s`.
    """

    kind: Kind
    x: float
    y: float
    yaw_rad: float
    length_m: float
    curvature: float
    angle_rad: float
    enter_speed: float
    top_speed: float
    leave_speed: float
    rise_s: float
    fall_s: float
    time_s: float

    @property
    def radius_m(self) -> float:
        """The arc's radius: infinite for a line, 0 for a turn on the spot."""
        if self.kind == "turn":
            return 0.0
        return 1.0 / abs(self.curvature) if self.curvature else np.inf

    def poses(self, ways_m: Floats) -> Floats:
        """Poses `(n, 3)` after ways `(n,)` (m, from 0 to |length|); for a turn ways are angles (rad, from 0 to |angle|)."""
        ways = np.asarray(ways_m, dtype=np.float64)
        if self.kind == "turn":
            yaw = self.yaw_rad + np.sign(self.angle_rad) * ways
            return np.column_stack([np.full_like(ways, self.x), np.full_like(ways, self.y), yaw])
        signed = np.copysign(1.0, self.length_m) * ways
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
        """Its length (m), or the angle (rad) of a turn on the spot."""
        return abs(self.angle_rad) if self.kind == "turn" else abs(self.length_m)

    @property
    def end(self) -> Floats:
        """The pose `(3,)` where it ends."""
        return np.asarray(self.poses(np.array([self.extent]))[0])


@dataclass(frozen=True, slots=True)
class ArcLinePath:
    """Segments that follow each other with continuous heading, from rest to rest."""

    segments: tuple[Segment, ...]

    @property
    def length_m(self) -> float:
        """The way driven."""
        return float(sum(abs(s.length_m) for s in self.segments))

    @property
    def time_s(self) -> float:
        """The time it takes."""
        return float(sum(s.time_s for s in self.segments))

    def sampled(self, spacing_m: float) -> tuple[Floats, Floats, Floats]:
        """Times `(n,)` (s), poses `(n, 3)` and speeds `(n,)` (m/s, negative backwards), at most `spacing_m` (or rad) apart.

        Both ends of every segment are among them, joints once.
        """
        times, poses, speeds = [np.zeros(1)], [self.segments[0].poses(np.zeros(1))], [np.zeros(1)]
        clock = 0.0
        for segment in self.segments:
            count = max(int(np.ceil(segment.extent / spacing_m)), 1)
            ways = segment.extent * np.arange(1, count + 1) / count
            at, speed = _timing(segment, ways)
            times.append(clock + at)
            poses.append(segment.poses(ways))
            speeds.append(np.copysign(speed, segment.length_m))
            clock += segment.time_s
        return np.concatenate(times), np.concatenate(poses), np.concatenate(speeds)


def _timing(segment: Segment, ways: Floats) -> tuple[Floats, Floats]:
    """Times after its begin and speeds at ways along a segment: speed rises, holds and falls at constant rates.

    A turn on the spot is reported with a constant rate.
    """
    if segment.kind == "turn":
        return segment.time_s * ways / segment.extent, np.zeros_like(ways)
    v0, top, v1 = segment.enter_speed, segment.top_speed, segment.leave_speed
    rise, fall = segment.rise_s, segment.fall_s
    up, down = 0.5 * (v0 + top) * rise, 0.5 * (top + v1) * fall
    left = segment.extent - ways
    speed = np.full_like(ways, top)
    times = rise + (ways - up) / top
    climbing, falling = ways < up, left < down
    if rise > 0.0:
        gain = (top - v0) / rise
        speed[climbing] = np.sqrt(np.maximum(v0**2 + 2.0 * gain * ways[climbing], 0.0))
        times[climbing] = (speed[climbing] - v0) / gain
    if fall > 0.0:
        loss = (top - v1) / fall
        speed[falling] = np.sqrt(np.maximum(v1**2 + 2.0 * loss * left[falling], 0.0))
        times[falling] = segment.time_s - (speed[falling] - v1) / loss
    return times, speed
