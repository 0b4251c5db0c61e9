"""RFID reader: a link budget gives the power from each tag, and the power decides which tags a round reads."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, TagInventory, as_float32
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.extrinsics import planar
from gridslam.simulation.sensors.sensor_config import Antenna
from gridslam.simulation.sensors.timing import Schedule

MIN_FACING = 0.1  # smallest factor for a tag's orientation: some power arrives from behind
THRESHOLD_DBM = -70.0
TAG_CLEARANCE_M = 0.02  # a surface this close to the tag does not block it


class RfidReader:
    """Inventory rounds of one antenna, including empty ones."""

    def __init__(self, config: Antenna, start_ns: int, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._schedule = Schedule(config, start_ns, rng, phase=0.3)

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The rounds of this step."""
        if not self._schedule.is_due(now_ns):
            return []
        self._schedule.advance()
        ids, powers = self._round(robot.pose, scene, now_ns * 1e-9)
        stamp = self._schedule.stamp_ns(now_ns)
        if stamp is None:
            return []
        return [TagInventory(stamp, self._config.name, self._config.name, ids, powers)]

    def _round(
        self, pose: NDArray[np.float64], scene: Scene, time_s: float
    ) -> tuple[tuple[str, ...], tuple[float, ...]]:
        tags = scene.tag_poses()
        if not tags:
            return (), ()
        count = len(tags)
        power = mean_power_db(self._config, pose, np.array(list(tags.values())), scene, time_s)
        power = power + self._config.fading_db * self._rng.standard_normal(count)
        read = (power > 0.0) & (self._rng.random(count) >= self._config.missed)
        draw, which = float(self._rng.random()), int(self._rng.integers(count))
        if draw < self._config.false_reads:
            read[which] = True
        names = list(tags)
        found = [i for i in range(count) if read[i]]
        strengths = tuple(as_float32(round(THRESHOLD_DBM + max(float(power[i]), 0.0), 1)) for i in found)
        return tuple(names[i] for i in found), strengths


def mean_power_db(
    config: Antenna, pose: NDArray[np.float64], tags: NDArray[np.float64], scene: Scene, time_s: float
) -> NDArray[np.float64]:
    """Power `(n,)` (dB above the reader's threshold, without fading) from tags at poses `(n, 3)`."""
    antenna = se2.compose(pose, planar(config.extrinsics))
    offset = tags[:, :2] - antenna[:2]
    distance = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 0.05)
    direction = np.arctan2(offset[:, 1], offset[:, 0])
    bearing = np.degrees(se2.wrap_angle(direction - antenna[2]))
    facing = np.cos(se2.wrap_angle(direction + math.pi - tags[:, 2]))
    rays = np.column_stack([np.tile(antenna[:2], (len(tags), 1)), np.cos(direction), np.sin(direction)])
    max_range_m = float(distance.max())
    blocked = scene.cast(rays, max_range_m, time_s).ranges_m < distance - TAG_CLEARANCE_M
    power = config.gain_db - 40.0 * np.log10(distance) - 12.0 * (bearing / config.half_power_deg) ** 2
    power += 20.0 * np.log10(np.maximum(facing, MIN_FACING)) - config.wall_loss_db * blocked
    return np.asarray(power)
