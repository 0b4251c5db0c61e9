"""The heading by a gyro, integrated over yaw rates, and its bias by comparison with another heading."""

from __future__ import annotations

from collections import deque

from gridslam.core.messages import Imu

MAX_GAP_S = 0.5  # longest gap between two yaw rates over which a rotation is known
BIAS_WINDOW_S = 30.0  # time over which the bias is averaged
MAX_BIAS_RADPS = 0.2  # a larger difference from the other heading is a fault of one of the two


class GyroHeading:
    """Rotation between two stamps by the gyro, for stamps that are never older than the rates it keeps.

    Yaw rates are joined by straight lines. The bias is the mean difference from the rotations that `compare` is given.
    """

    def __init__(self) -> None:
        self._headings: deque[tuple[int, float, float]] = deque()  # stamp, yaw rate, integrated yaw
        self._bias_radps = 0.0
        self._compared_s = 0.0

    @property
    def bias_radps(self) -> float:
        """Yaw rate that the gyro reports at rest (rad/s)."""
        return self._bias_radps

    def add(self, imu: Imu, is_flipped: bool) -> None:
        """Add a yaw rate; its sign is changed for a sensor mounted upside down. Out-of-order stamps are left out."""
        rate = -imu.wz_radps if is_flipped else imu.wz_radps
        if not self._headings:
            self._headings.append((imu.stamp_ns, rate, 0.0))
            return
        stamp_ns, last_rate, heading = self._headings[-1]
        elapsed_s = (imu.stamp_ns - stamp_ns) * 1e-9
        if elapsed_s <= 0.0:
            return
        if elapsed_s > MAX_GAP_S:
            self._headings.clear()
        self._headings.append((imu.stamp_ns, rate, heading + 0.5 * (last_rate + rate) * elapsed_s))

    def rotation(self, start_ns: int, end_ns: int) -> float | None:
        """Rotation (rad) between two stamps without the bias; None if the yaw rates do not cover them.

        What lies before the start is forgotten.
        """
        while len(self._headings) > 1 and self._headings[1][0] <= start_ns:
            self._headings.popleft()
        start, end = self._heading_at(start_ns), self._heading_at(end_ns)
        if start is None or end is None:
            return None
        return end - start - self._bias_radps * (end_ns - start_ns) * 1e-9

    def compare(self, rotation_rad: float, true_rotation_rad: float, elapsed_s: float) -> None:
        """Correct the bias by a rotation that `rotation` has returned and the same rotation by a better source."""
        difference = (rotation_rad - true_rotation_rad) / elapsed_s
        if abs(difference) > MAX_BIAS_RADPS:
            return
        self._compared_s = min(self._compared_s + elapsed_s, BIAS_WINDOW_S)
        self._bias_radps += difference * elapsed_s / self._compared_s

    def _heading_at(self, stamp_ns: int) -> float | None:
        """The integrated yaw (rad), linear between two yaw rates; up to half their largest gap beyond the ends."""
        if not self._headings:
            return None
        previous = None
        for entry in self._headings:
            if entry[0] >= stamp_ns:
                break
            previous = entry
        else:
            return _extrapolated(self._headings[-1], stamp_ns)
        if previous is None:
            return _extrapolated(entry, stamp_ns)
        fraction = (stamp_ns - previous[0]) / (entry[0] - previous[0])
        return previous[2] + fraction * (entry[2] - previous[2])


def _extrapolated(entry: tuple[int, float, float], stamp_ns: int) -> float | None:
    elapsed_s = (stamp_ns - entry[0]) * 1e-9
    return entry[2] + entry[1] * elapsed_s if abs(elapsed_s) < 0.5 * MAX_GAP_S else None
